// What ends an episode before its horizon.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmeta_core/mjcf/terms.h"
#include "quantities.h"

namespace pmeta {

Registry<TermRow<TerminationTerm>>& TerminationTerm::registry() {
  static Registry<TermRow<TerminationTerm>> rows("termination term");
  return rows;
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A number that must stay within two bounds.
class Outside : public TerminationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("low", low_, "the episode is over below it");
    settings.bind("high", high_, "the episode is over above it");
  }
  void find(const Elements& elements) override {
    if (low_ >= high_) {
      elements.refuse("low", "is " + formatNumber(low_) + " but must be below high, which is " +
                                 formatNumber(high_) + ".");
    }
  }

 protected:
  bool isOutside(double value) const { return value < low_ || value > high_; }
  double low_ = -1e6;
  double high_ = 1e6;
};

class JointOutside : public Outside {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("joint", joint_, "whose position, rad or m; root.z is a number of a free joint");
    Outside::bind(settings);
  }
  void find(const Elements& elements) override {
    Outside::find(elements);
    number_ = elements.position("joint", joint_);
  }
  bool isOver(const Robot& robot) const override {
    return isOutside(robot.data->qpos[number_.index]);
  }
  std::vector<Quantity> bounds() const override {
    return {{positionName(number_), number_.unit, low_, high_}};
  }

 private:
  std::string joint_;
  JointNumber number_;
};
const RegisteredTerm<TerminationTerm, JointOutside> kJointOutside(
    "joint_outside", "a joint's position is below low or above high, rad or m");

class HeightOutside : public Outside {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("body", body_, "whose height, m");
    Outside::bind(settings);
  }
  void find(const Elements& elements) override {
    Outside::find(elements);
    index_ = elements.one(Element::kBody, "body", body_);
  }
  bool isOver(const Robot& robot) const override {
    return isOutside(robot.data->xpos[3 * index_ + 2]);
  }
  std::vector<Quantity> bounds() const override { return {{body_ + "_z", "m", low_, high_}}; }

 private:
  std::string body_;
  int index_ = 0;
};
const RegisteredTerm<TerminationTerm, HeightOutside> kHeightOutside(
    "height_outside", "a body's frame is below low or above high, m");

class Tilted : public TerminationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("body", body_, "whose z axis");
    settings.bind("angle", angle_, "from up, rad, beyond which the episode is over",
                  Range::between(0, 3.141592653589793));
  }
  void find(const Elements& elements) override {
    index_ = elements.one(Element::kBody, "body", body_);
    least_ = std::cos(angle_);
  }
  bool isOver(const Robot& robot) const override {
    return robot.data->xmat[9 * index_ + 8] < least_;
  }

 private:
  std::string body_;
  double angle_ = 1;
  int index_ = 0;
  double least_ = 0;
};
const RegisteredTerm<TerminationTerm, Tilted> kTilted(
    "tilted", "a body's z axis is further than an angle (rad) from up");

class Touches : public TerminationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("bodies", bodies_, "that must touch nothing, by name");
  }
  void find(const Elements& elements) override {
    const std::vector<int> bodies = elements.all(Element::kBody, "bodies", bodies_);
    const mjModel* m = elements.model().get();
    touched_.assign(static_cast<std::size_t>(m->ngeom), false);
    for (int geom = 0; geom < m->ngeom; ++geom) {
      touched_[static_cast<std::size_t>(geom)] =
          std::find(bodies.begin(), bodies.end(), m->geom_bodyid[geom]) != bodies.end();
    }
  }
  bool isOver(const Robot& robot) const override {
    for (int i = 0; i < robot.data->ncon; ++i) {
      const mjContact& contact = robot.data->contact[i];
      if (contact.exclude == 0 && contact.dist <= 0 &&
          (touched_[static_cast<std::size_t>(contact.geom1)] ||
           touched_[static_cast<std::size_t>(contact.geom2)])) {
        return true;
      }
    }
    return false;
  }

 private:
  std::vector<std::string> bodies_;
  std::vector<bool> touched_;
};
const RegisteredTerm<TerminationTerm, Touches> kTouches("touches",
                                                        "one of some bodies touches anything");

}  // namespace
}  // namespace pmeta
