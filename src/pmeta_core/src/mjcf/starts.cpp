// How an episode starts.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <utility>

#include "pmeta_core/base/format.h"
#include "pmeta_core/mjcf/terms.h"

namespace pmeta {

Registry<TermRow<StartTerm>>& StartTerm::registry() {
  static Registry<TermRow<StartTerm>> rows("start term");
  return rows;
}

namespace {

double draw(double spread, bool normal, Rng& rng) {
  return spread * (normal ? rng.normal() : 2 * rng.uniform() - 1);
}

class JointNoise : public StartTerm {
 public:
  void bind(TermSettings& settings) override {
    const std::vector<std::string> shapes = {"uniform", "normal"};
    settings.bind("joints", joints_, "that are disturbed: of all positions first, then velocities");
    settings.bind("position", position_,
                  "noise on positions, rad and m: half width, or deviation of a normal one",
                  Range::atLeast(0));
    settings.bind("velocity", velocity_, "the same on velocities, rad/s and m/s",
                  Range::atLeast(0));
    settings.bind("position_noise", position_noise_, "its distribution", shapes);
    settings.bind("velocity_noise", velocity_noise_, "its distribution", shapes);
  }
  void find(const Elements& elements) override {
    positions_ = elements.positions("joints", joints_);
    velocities_ = elements.velocities("joints", joints_);
  }
  void start(const mjModel*, mjData* data, Rng& rng) const override {
    if (position_ > 0) {
      const bool normal = position_noise_ == "normal";
      for (const JointNumber& one : positions_)
        data->qpos[one.index] += draw(position_, normal, rng);
    }
    if (velocity_ > 0) {
      const bool normal = velocity_noise_ == "normal";
      for (const JointNumber& one : velocities_) {
        data->qvel[one.index] += draw(velocity_, normal, rng);
      }
    }
  }

 private:
  std::vector<std::string> joints_ = {"all"};
  double position_ = 0;
  double velocity_ = 0;
  std::string position_noise_ = "uniform";
  std::string velocity_noise_ = "uniform";
  std::vector<JointNumber> positions_, velocities_;
};
const RegisteredTerm<StartTerm, JointNoise> kJointNoise(
    "joint_noise", "noise on the positions (rad, m) and velocities (rad/s, m/s) of joints");

class JointUniform : public StartTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("joints", joints_, "that start anywhere; root.x is a number of a free joint");
    settings.bind("low", low_, "least position, rad or m");
    settings.bind("high", high_, "greatest position, rad or m");
  }
  void find(const Elements& elements) override {
    if (low_ > high_) {
      elements.refuse("low", "is " + formatNumber(low_) + " but must be at most high, which is " +
                                 formatNumber(high_) + ".");
    }
    numbers_ = elements.positions("joints", joints_);
  }
  void start(const mjModel*, mjData* data, Rng& rng) const override {
    for (const JointNumber& one : numbers_) {
      data->qpos[one.index] = low_ + (high_ - low_) * rng.uniform();
    }
  }

 private:
  std::vector<std::string> joints_;
  double low_ = 0;
  double high_ = 0;
  std::vector<JointNumber> numbers_;
};
const RegisteredTerm<StartTerm, JointUniform> kJointUniform(
    "joint_uniform", "positions of joints anywhere from low to high, rad or m");

class Keyframe : public StartTerm {
 public:
  void bind(TermSettings& settings) override { settings.bind("keyframe", name_, "of the model"); }
  void find(const Elements& elements) override {
    index_ = elements.one(Element::kKeyframe, "keyframe", name_);
  }
  void start(const mjModel* m, mjData* data, Rng&) const override {
    std::copy_n(m->key_qpos + index_ * m->nq, m->nq, data->qpos);
    std::copy_n(m->key_qvel + index_ * m->nv, m->nv, data->qvel);
    std::copy_n(m->key_act + index_ * m->na, m->na, data->act);
    std::copy_n(m->key_ctrl + index_ * m->nu, m->nu, data->ctrl);
  }

 private:
  std::string name_;
  int index_ = 0;
};
const RegisteredTerm<StartTerm, Keyframe> kKeyframe(
    "keyframe", "positions, velocities and controls of a keyframe of the model");

class Hold : public StartTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("actuators", actuators_, "position servos of the model, by name");
  }
  void find(const Elements& elements) override {
    const mjModel* m = elements.model().get();
    for (const int actuator : elements.all(Element::kActuator, "actuators", actuators_)) {
      const int joint = m->actuator_trnid[2 * actuator];
      const bool drives_one = m->actuator_trntype[actuator] == mjTRN_JOINT &&
                              m->jnt_type[joint] != mjJNT_FREE && m->jnt_type[joint] != mjJNT_BALL;
      if (!drives_one) {
        elements.refuse("actuators", "holds " + shown(elements.name(Element::kActuator, actuator)) +
                                         ", which drives no hinge or slide.");
      }
      servos_.emplace_back(actuator, m->jnt_qposadr[joint]);
    }
  }
  void start(const mjModel*, mjData* data, Rng&) const override {
    for (const auto& [actuator, position] : servos_) data->ctrl[actuator] = data->qpos[position];
  }

 private:
  std::vector<std::string> actuators_ = {"all"};
  std::vector<std::pair<int, int>> servos_;  // and where in the configuration its joint is
};
const RegisteredTerm<StartTerm, Hold> kHold(
    "hold", "set points of position servos where their joints are, rad or m: give it last");

}  // namespace
}  // namespace pmeta
