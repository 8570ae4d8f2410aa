// What may be observed of a robot's joints, bodies, sites and sensors.
#include <mujoco/mujoco.h>

#include <algorithm>

#include "pmeta_core/mjcf/terms.h"
#include "quantities.h"

namespace pmeta {

Registry<TermRow<ObservationTerm>>& ObservationTerm::registry() {
  static Registry<TermRow<ObservationTerm>> rows("observation term");
  return rows;
}

namespace {

class JointNumbers : public ObservationTerm {
 public:
  explicit JointNumbers(bool velocity) : velocity_(velocity) {}
  void bind(TermSettings& settings) override {
    settings.bind("joints", joints_,
                  velocity_ ? "whose velocities; root.vx to root.wz are those of a free joint"
                            : "whose positions; root.x to root.qz are those of a free joint");
  }
  void find(const Elements& elements) override {
    numbers_ =
        velocity_ ? elements.velocities("joints", joints_) : elements.positions("joints", joints_);
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const JointNumber& one : numbers_) {
      Quantity quantity{velocity_ ? velocityName(one) : positionName(one), one.unit};
      if (one.unit.empty()) quantity.low = -1, quantity.high = 1;
      quantities.push_back(quantity);
    }
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    const double* all = velocity_ ? robot.data->qvel : robot.data->qpos;
    for (const JointNumber& one : numbers_) *numbers++ = all[one.index];
  }

 private:
  bool velocity_;
  std::vector<std::string> joints_ = {"all"};
  std::vector<JointNumber> numbers_;
};

struct JointPositions : JointNumbers {
  JointPositions() : JointNumbers(false) {}
};
struct JointVelocities : JointNumbers {
  JointVelocities() : JointNumbers(true) {}
};
const RegisteredTerm<ObservationTerm, JointPositions> kJointPositions(
    "joint_positions", "positions of joints: rad of hinges, m of slides");
const RegisteredTerm<ObservationTerm, JointVelocities> kJointVelocities(
    "joint_velocities", "velocities of joints: rad/s of hinges, m/s of slides");

/// Three numbers of one element, of which some axes are observed.
class AxesOf : public ObservationTerm {
 public:
  AxesOf(Element kind, const char* setting, const char* what, const char* unit)
      : kind_(kind), setting_(setting), what_(what), unit_(unit) {}
  void bind(TermSettings& settings) override {
    settings.bind(setting_, name_, "whose");
    settings.bind("axes", axes_, "of the world, which to observe", {"x", "y", "z"});
  }
  void find(const Elements& elements) override { index_ = elements.one(kind_, setting_, name_); }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& axis : axes_) quantities.push_back({name_ + what_ + "_" + axis, unit_});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    double three[3];
    read(robot, three);
    for (const std::string& axis : axes_) *numbers++ = three[axis[0] - 'x'];
  }

 protected:
  int index_ = 0;

 private:
  virtual void read(const Robot& robot, double* three) const = 0;

  Element kind_;
  const char* setting_;
  const char* what_;
  const char* unit_;
  std::string name_;
  std::vector<std::string> axes_ = {"x", "y", "z"};
};

class BodyPosition : public AxesOf {
 public:
  BodyPosition() : AxesOf(Element::kBody, "body", "", "m") {}

 private:
  void read(const Robot& robot, double* three) const override {
    mju_copy3(three, robot.data->xpos + 3 * index_);
  }
};
const RegisteredTerm<ObservationTerm, BodyPosition> kBodyPosition(
    "body_position", "where a body's frame is, m, world axes");

class SitePosition : public AxesOf {
 public:
  SitePosition() : AxesOf(Element::kSite, "site", "", "m") {}

 private:
  void read(const Robot& robot, double* three) const override {
    mju_copy3(three, robot.data->site_xpos + 3 * index_);
  }
};
const RegisteredTerm<ObservationTerm, SitePosition> kSitePosition("site_position",
                                                                  "where a site is, m, world axes");

class BodyVelocity : public AxesOf {
 public:
  BodyVelocity() : AxesOf(Element::kBody, "body", "_velocity", "m/s") {}

 private:
  void read(const Robot& robot, double* three) const override {
    double six[6];
    mj_objectVelocity(robot.model, robot.data, mjOBJ_XBODY, index_, six, 0);
    mju_copy3(three, six + 3);
  }
};
const RegisteredTerm<ObservationTerm, BodyVelocity> kBodyVelocity(
    "body_velocity", "how fast a body's frame moves, m/s, world axes");

class BodyAngularVelocity : public AxesOf {
 public:
  BodyAngularVelocity() : AxesOf(Element::kBody, "body", "_angular_velocity", "rad/s") {}

 private:
  void read(const Robot& robot, double* three) const override {
    double six[6];
    mj_objectVelocity(robot.model, robot.data, mjOBJ_XBODY, index_, six, 0);
    mju_copy3(three, six);
  }
};
const RegisteredTerm<ObservationTerm, BodyAngularVelocity> kBodyAngularVelocity(
    "body_angular_velocity", "how fast a body turns, rad/s, world axes");

class BodyOrientation : public ObservationTerm {
 public:
  void bind(TermSettings& settings) override { settings.bind("body", body_, "whose"); }
  void find(const Elements& elements) override {
    index_ = elements.one(Element::kBody, "body", body_);
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const char* part : {"w", "x", "y", "z"}) {
      quantities.push_back({body_ + "_quaternion_" + part, "", -1, 1});
    }
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    mju_copy4(numbers, robot.data->xquat + 4 * index_);
  }

 private:
  std::string body_;
  int index_ = 0;
};
const RegisteredTerm<ObservationTerm, BodyOrientation> kBodyOrientation(
    "body_orientation", "how a body is turned: a unit quaternion w, x, y, z");

class Sensor : public ObservationTerm {
 public:
  void bind(TermSettings& settings) override { settings.bind("sensor", sensor_, "of the model"); }
  void find(const Elements& elements) override {
    const int index = elements.one(Element::kSensor, "sensor", sensor_);
    const mjModel* m = elements.model().get();
    address_ = m->sensor_adr[index];
    size_ = m->sensor_dim[index];
    unit_ = sensorUnit(m->sensor_type[index]);
  }
  std::vector<Quantity> quantities() const override {
    if (size_ == 1) return {{sensor_, unit_}};
    std::vector<Quantity> quantities;
    for (int i = 0; i < size_; ++i)
      quantities.push_back({sensor_ + "_" + std::to_string(i), unit_});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    std::copy_n(robot.data->sensordata + address_, size_, numbers);
  }

 private:
  std::string sensor_;
  int address_ = 0;
  int size_ = 0;
  std::string unit_;
};
const RegisteredTerm<ObservationTerm, Sensor> kSensor(
    "sensor", "what a sensor of the model measures, in its unit");

class ContactForces : public ObservationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("bodies", bodies_, "on which; the world is a body, too");
  }
  void find(const Elements& elements) override {
    indices_ = elements.all(Element::kBody, "bodies", bodies_);
    for (const int body : indices_) names_.push_back(elements.name(Element::kBody, body));
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& name : names_) {
      for (const char* axis : {"x", "y", "z"}) {
        quantities.push_back({name + "_contact_torque_" + axis, "N m"});
      }
      for (const char* axis : {"x", "y", "z"}) {
        quantities.push_back({name + "_contact_force_" + axis, "N"});
      }
    }
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    for (const int body : indices_) {
      numbers = std::copy_n(robot.data->cfrc_ext + 6 * body, 6, numbers);
    }
  }
  bool needsContactForces() const override { return true; }

 private:
  std::vector<std::string> bodies_ = {"all"};
  std::vector<int> indices_;
  std::vector<std::string> names_;
};
const RegisteredTerm<ObservationTerm, ContactForces> kContactForces(
    "contact_forces",
    "external torque (N m) and force (N) on bodies, six numbers each, about the centre of mass of "
    "the whole");

}  // namespace
}  // namespace pmeta
