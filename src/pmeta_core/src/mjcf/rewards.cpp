// What a step may be rewarded by: velocities, posture and costs. Those of goals are in goals.cpp.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/mjcf/terms.h"

namespace pmeta {

Registry<TermRow<RewardTerm>>& RewardTerm::registry() {
  static Registry<TermRow<RewardTerm>> rows("reward term");
  return rows;
}

namespace {

/// A quantity of one body.
class OfBody : public RewardTerm {
 public:
  void bind(TermSettings& settings) override { settings.bind("body", body_, "whose"); }
  void find(const Elements& elements) override {
    index_ = elements.one(Element::kBody, "body", body_);
  }

 protected:
  int index() const { return index_; }  ///< the model's, of that body

 private:
  std::string body_;
  int index_ = 0;
};

/// A quantity of one joint.
class OfJoint : public RewardTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("joint", joint_, "whose; root.x is a number of a free joint");
  }
  void find(const Elements& elements) override {
    index_ = elements.position("joint", joint_).index;
  }

 protected:
  double position(const Robot& robot) const { return robot.data->qpos[index_]; }  ///< rad or m

 private:
  std::string joint_;
  int index_ = 0;
};

/// How fast the origin of a body's frame moved along a direction, on average over the step.
class BodyVelocity : public OfBody {
 public:
  void bind(TermSettings& settings) override {
    OfBody::bind(settings);
    settings.bind("axis", axis_, "of the world, along which", {"x", "y", "z"});
    settings.bind("heading", heading_, "angle by which x and y are turned about z, rad");
  }
  void find(const Elements& elements) override {
    OfBody::find(elements);
    const double c = std::cos(heading_);
    const double s = std::sin(heading_);
    const double directions[3][3] = {{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
    mju_copy3(direction_, directions[axis_[0] - 'x']);
  }
  int memory() const override { return 3; }
  void remember(const Robot& robot, double* memory) const override {
    mju_copy3(memory, robot.data->xpos + 3 * index());
  }
  double value(const Robot& robot, const double* memory) const override {
    const double* now = robot.data->xpos + 3 * index();
    double speed = 0;
    for (int i = 0; i < 3; ++i) speed += (now[i] - memory[i]) / robot.dt * direction_[i];
    return speed;
  }

 private:
  std::string axis_ = "x";
  double heading_ = 0;
  double direction_[3] = {1, 0, 0};
};

class JointVelocity : public OfJoint {
 public:
  int memory() const override { return 1; }
  void remember(const Robot& robot, double* memory) const override { *memory = position(robot); }
  double value(const Robot& robot, const double* memory) const override {
    return (position(robot) - *memory) / robot.dt;
  }
};

/// How far `Measured` is from what it should be.
template <class Measured>
class ErrorOf : public Measured {
 public:
  void bind(TermSettings& settings) override {
    Measured::bind(settings);
    settings.bind("target", target_, "what it should be, in the same unit");
  }
  double value(const Robot& robot, const double* memory) const override {
    return std::abs(Measured::value(robot, memory) - target_);
  }

 private:
  double target_ = 0;
};

const RegisteredTerm<RewardTerm, BodyVelocity> kBodyVelocity(
    "body_velocity", "how fast a body moves along an axis or heading, m/s, mean over the step");
const RegisteredTerm<RewardTerm, ErrorOf<BodyVelocity>> kBodyVelocityError(
    "body_velocity_error", "distance of that from a target, m/s: give it a weight below 0");
const RegisteredTerm<RewardTerm, JointVelocity> kJointVelocity(
    "joint_velocity", "how fast a joint moves, rad/s or m/s, mean over the step");
const RegisteredTerm<RewardTerm, ErrorOf<JointVelocity>> kJointVelocityError(
    "joint_velocity_error",
    "distance of that from a target, rad/s or m/s: give it a weight below 0");

class JointPosition : public OfJoint {
 public:
  double value(const Robot& robot, const double*) const override { return position(robot); }
};
const RegisteredTerm<RewardTerm, ErrorOf<JointPosition>> kJointPositionError(
    "joint_position_error",
    "distance of a joint from a target, rad or m: give it a weight below 0");

class Height : public OfBody {
 public:
  double value(const Robot& robot, const double*) const override {
    return robot.data->xpos[3 * index() + 2];
  }
};
const RegisteredTerm<RewardTerm, Height> kHeight("height", "of a body's frame, m");
const RegisteredTerm<RewardTerm, ErrorOf<Height>> kHeightError(
    "height_error", "distance of that from a target, m: give it a weight below 0");

class Upright : public OfBody {
 public:
  double value(const Robot& robot, const double*) const override {
    return robot.data->xmat[9 * index() + 8];
  }
};
const RegisteredTerm<RewardTerm, Upright> kUpright(
    "upright", "cosine of the angle from up to a body's z axis: 1 upright, -1 head down");

class SiteDistance : public RewardTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("site", site_, "from which");
    settings.bind("to", to_, "another site, to which");
  }
  void find(const Elements& elements) override {
    index_ = elements.one(Element::kSite, "site", site_);
    to_index_ = elements.one(Element::kSite, "to", to_);
  }
  double value(const Robot& robot, const double*) const override {
    return mju_dist3(robot.data->site_xpos + 3 * index_, robot.data->site_xpos + 3 * to_index_);
  }

 private:
  std::string site_, to_;
  int index_ = 0, to_index_ = 0;
};
const RegisteredTerm<RewardTerm, SiteDistance> kSiteDistance(
    "site_distance", "between two sites, m: give it a weight below 0");

class Alive : public RewardTerm {
 public:
  void bind(TermSettings&) override {}
  void find(const Elements&) override {}
  double value(const Robot&, const double*) const override { return 1; }
};
const RegisteredTerm<RewardTerm, Alive> kAlive("alive", "1 in every step");

class ControlCost : public RewardTerm {
 public:
  void bind(TermSettings&) override {}
  void find(const Elements&) override {}
  double value(const Robot& robot, const double*) const override {
    return mju_dot(robot.action, robot.action, static_cast<int>(robot.action_size));
  }
};
const RegisteredTerm<RewardTerm, ControlCost> kControlCost(
    "control_cost",
    "sum of the squares of the action, each from -1 to 1: give it a weight below 0");

class ContactCost : public RewardTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("bodies", bodies_, "on which; the world is a body, too");
    settings.bind("clip", clip_, "each torque and force counts from -clip to clip, N m and N",
                  Range::above(0));
  }
  void find(const Elements& elements) override {
    indices_ = elements.all(Element::kBody, "bodies", bodies_);
  }
  double value(const Robot& robot, const double*) const override {
    double sum = 0;
    for (const int body : indices_) {
      for (int i = 6 * body; i < 6 * body + 6; ++i) {
        const double force = std::clamp(robot.data->cfrc_ext[i], -clip_, clip_);
        sum += force * force;
      }
    }
    return sum;
  }
  bool needsContactForces() const override { return true; }

 private:
  std::vector<std::string> bodies_ = {"all"};
  double clip_ = 1;
  std::vector<int> indices_;
};
const RegisteredTerm<RewardTerm, ContactCost> kContactCost(
    "contact_cost",
    "sum of the squares of external torques (N m) and forces (N) on bodies: give it a weight below "
    "0");

class Power : public RewardTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("actuators", actuators_, "of the model, by name");
  }
  void find(const Elements& elements) override {
    indices_ = elements.all(Element::kActuator, "actuators", actuators_);
  }
  double value(const Robot& robot, const double*) const override {
    double sum = 0;
    for (const int i : indices_) {
      sum += std::abs(robot.data->actuator_force[i] * robot.data->actuator_velocity[i]);
    }
    return sum;
  }

 private:
  std::vector<std::string> actuators_ = {"all"};
  std::vector<int> indices_;
};
const RegisteredTerm<RewardTerm, Power> kPower(
    "power", "that actuators take or give, W, at the step's end: give it a weight below 0");

class SensorValue : public RewardTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("sensor", sensor_, "of the model");
    settings.bind("component", component_, "which of its numbers, from 0", Range::atLeast(0));
  }
  void find(const Elements& elements) override {
    const int index = elements.one(Element::kSensor, "sensor", sensor_);
    const mjModel* m = elements.model().get();
    if (component_ >= m->sensor_dim[index]) {
      elements.refuse("component", "is " + std::to_string(component_) + " but that sensor has " +
                                       std::to_string(m->sensor_dim[index]) + " numbers, from 0.");
    }
    address_ = m->sensor_adr[index] + component_;
  }
  double value(const Robot& robot, const double*) const override {
    return robot.data->sensordata[address_];
  }

 private:
  std::string sensor_;
  int component_ = 0;
  int address_ = 0;
};
const RegisteredTerm<RewardTerm, SensorValue> kSensorValue(
    "sensor", "a number of a sensor of the model, in its unit");
const RegisteredTerm<RewardTerm, ErrorOf<SensorValue>> kSensorError(
    "sensor_error", "distance of that from a target, in its unit: give it a weight below 0");

}  // namespace
}  // namespace pmeta
