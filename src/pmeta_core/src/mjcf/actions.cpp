// From an action's numbers, each in [-1, 1], to what drives the robot; and what is observed of it.
#include <mujoco/mujoco.h>

#include <algorithm>

#include "pmeta_core/base/format.h"
#include "pmeta_core/mjcf/terms.h"
#include "quantities.h"

namespace pmeta {

Registry<TermRow<ActionTerm>>& ActionTerm::registry() {
  static Registry<TermRow<ActionTerm>> rows("action term");
  return rows;
}

namespace {

struct ControlRange {
  int actuator;
  double low, high;
};

/// Terms that set controls of actuators.
class Actuators : public ActionTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("actuators", actuators_, "of the model, by name");
    settings.bind(
        "limit", limit_,
        "of actuators to which the model gives no control range: from -limit to limit, in "
        "the unit of the actuator's control; 0: it must give one",
        Range::atLeast(0));
  }
  void find(const Elements& elements) override {
    const mjModel* m = elements.model().get();
    for (const int actuator : elements.all(Element::kActuator, "actuators", actuators_)) {
      const std::string name = elements.name(Element::kActuator, actuator);
      const double* range = m->actuator_ctrlrange + 2 * actuator;
      if (m->actuator_ctrllimited[actuator] != 0) {
        ranges_.push_back({actuator, range[0], range[1]});
      } else if (limit_ > 0) {
        ranges_.push_back({actuator, -limit_, limit_});
      } else {
        elements.refuse("actuators", "holds " + shown(name) +
                                         ", which has no control range: give it a ctrlrange in the "
                                         "model, or a limit here.");
      }
      names_.push_back(name);
    }
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& name : names_) quantities.push_back({name, "", -1, 1});
    return quantities;
  }

 protected:
  std::vector<ControlRange> ranges_;

 private:
  std::vector<std::string> actuators_ = {"all"};
  double limit_ = 0;
  std::vector<std::string> names_;
};

class Control : public Actuators {
 public:
  void act(const double* action, double, mjData_* data) const override {
    for (const ControlRange& range : ranges_) {
      // exact where the range is [-1, 1]
      data->ctrl[range.actuator] =
          (range.low + range.high) / 2 + (range.high - range.low) / 2 * *action++;
    }
  }
};
const RegisteredTerm<ActionTerm, Control> kControl(
    "control", "controls of actuators: -1 and 1 are the ends of each one's control range");

class ControlChange : public Actuators {
 public:
  void bind(TermSettings& settings) override {
    Actuators::bind(settings);
    settings.bind("rate", rate_, "by which 1 changes a control, in its unit per s",
                  Range::above(0));
  }
  void act(const double* action, double dt, mjData_* data) const override {
    for (const ControlRange& range : ranges_) {
      double& control = data->ctrl[range.actuator];
      control = std::clamp(control + rate_ * dt * *action++, range.low, range.high);
    }
  }

 private:
  double rate_ = 1;
};
const RegisteredTerm<ActionTerm, ControlChange> kControlChange(
    "control_change", "changes of the controls of actuators, which keep to their control range");

class JointForces : public ActionTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("joints", joints_, "that are driven without an actuator, as those of a URDF");
    settings.bind("limit", limit_, "what 1 stands for: N m at a hinge, N at a slide",
                  Range::above(0));
  }
  void find(const Elements& elements) override {
    numbers_ = elements.velocities("joints", joints_);
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const JointNumber& one : numbers_) {
      quantities.push_back({positionName(one) + "_force", "", -1, 1});
    }
    return quantities;
  }
  void act(const double* action, double, mjData_* data) const override {
    for (const JointNumber& one : numbers_) data->qfrc_applied[one.index] = limit_ * *action++;
  }

 private:
  std::vector<std::string> joints_ = {"all"};
  double limit_ = 1;
  std::vector<JointNumber> numbers_;
};
const RegisteredTerm<ActionTerm, JointForces> kJointForces(
    "joint_forces", "torques (N m) or forces (N) on joints that have no actuator");

class Controls : public ObservationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("actuators", actuators_, "of the model, by name");
  }
  void find(const Elements& elements) override {
    indices_ = elements.all(Element::kActuator, "actuators", actuators_);
    for (const int i : indices_) names_.push_back(elements.name(Element::kActuator, i));
  }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& name : names_) quantities.push_back({name + "_control", ""});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    for (const int i : indices_) *numbers++ = robot.data->ctrl[i];
  }

 private:
  std::vector<std::string> actuators_ = {"all"};
  std::vector<int> indices_;
  std::vector<std::string> names_;
};
const RegisteredTerm<ObservationTerm, Controls> kControls(
    "controls", "controls of actuators, in the unit of each");

class LastAction : public ObservationTerm {
 public:
  void bind(TermSettings&) override {}
  void find(const Elements& elements) override { names_ = elements.actions(); }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& name : names_) quantities.push_back({"last_" + name, "", -1, 1});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    std::copy_n(robot.action, robot.action_size, numbers);
  }

 private:
  std::vector<std::string> names_;
};
const RegisteredTerm<ObservationTerm, LastAction> kLastAction(
    "last_action", "the last action, from -1 to 1 each; 0 at the start");

}  // namespace
}  // namespace pmeta
