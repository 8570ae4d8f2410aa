// Places to go to: how they are drawn, and what is observed and rewarded of them.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/format.h"
#include "pmeta_core/mjcf/terms.h"

namespace pmeta {

Registry<TermRow<GoalTerm>>& GoalTerm::registry() {
  static Registry<TermRow<GoalTerm>> rows("goal term");
  return rows;
}

void GoalTerm::bind(TermSettings& settings) {
  settings.bind("body", body_, "mocap body of the model that is put there, to be seen; \"\": none");
}

void GoalTerm::find(const Elements& elements) {
  if (body_.empty()) return;
  mocap_ = elements.model().get()->body_mocapid[elements.one(Element::kBody, "body", body_)];
  if (mocap_ < 0) {
    elements.refuse("body", "is " + shown(body_) +
                                " but that is no mocap body: give it mocap=\"true\" in the model.");
  }
}

namespace {

double drawn(const std::vector<double>& range, Rng& rng) {
  return range[0] + (range[1] - range[0]) * rng.uniform();
}

void requireNumbers(const Elements& elements, const std::string& setting,
                    const std::vector<double>& values, std::size_t count) {
  if (values.size() == count) return;
  elements.refuse(setting, "has " + std::to_string(values.size()) + " numbers but must have " +
                               std::to_string(count) + ".");
}

void requireRange(const Elements& elements, const std::string& setting,
                  const std::vector<double>& range) {
  requireNumbers(elements, setting, range, 2);
  if (range[0] > range[1]) {
    elements.refuse(setting, "must be [low, high] but low is above high.");
  }
}

class Point : public GoalTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("position", position_, "x, y, z, m, world axes");
    GoalTerm::bind(settings);
  }
  void find(const Elements& elements) override {
    GoalTerm::find(elements);
    requireNumbers(elements, "position", position_, 3);
  }
  void draw(Rng&, double* position) const override {
    std::copy(position_.begin(), position_.end(), position);
  }

 private:
  std::vector<double> position_ = {0, 0, 0};
};
const RegisteredTerm<GoalTerm, Point> kPoint("point", "a place, the same in every episode, m");

class Box : public GoalTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("x", ranges_[0], "[low, high], m, world axes");
    settings.bind("y", ranges_[1], "[low, high], m");
    settings.bind("z", ranges_[2], "[low, high], m");
    GoalTerm::bind(settings);
  }
  void find(const Elements& elements) override {
    GoalTerm::find(elements);
    for (int axis = 0; axis < 3; ++axis) {
      requireRange(elements, std::string(1, static_cast<char>('x' + axis)), ranges_[axis]);
    }
  }
  void draw(Rng& rng, double* position) const override {
    for (const std::vector<double>& range : ranges_) *position++ = drawn(range, rng);
  }

 private:
  std::vector<double> ranges_[3] = {{0, 0}, {0, 0}, {0, 0}};
};
const RegisteredTerm<GoalTerm, Box> kBox("box", "anywhere in a box, m, drawn for each episode");

class Ring : public GoalTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("centre", centre_, "x, y, z, m, world axes");
    settings.bind("plane", plane_, "that the ring lies in", {"xy", "xz", "yz"});
    settings.bind("radius", radius_, "[low, high], m; all of the area is as likely",
                  Range::atLeast(0));
    settings.bind("angle", angle_, "[low, high], rad, from the first axis to the second");
    GoalTerm::bind(settings);
  }
  void find(const Elements& elements) override {
    GoalTerm::find(elements);
    requireNumbers(elements, "centre", centre_, 3);
    requireRange(elements, "radius", radius_);
    requireRange(elements, "angle", angle_);
  }
  void draw(Rng& rng, double* position) const override {
    const double inner = radius_[0] * radius_[0];
    const double outer = radius_[1] * radius_[1];
    const double r = std::sqrt(inner + (outer - inner) * rng.uniform());
    const double angle = drawn(angle_, rng);
    std::copy(centre_.begin(), centre_.end(), position);
    position[plane_[0] - 'x'] += r * std::cos(angle);
    position[plane_[1] - 'x'] += r * std::sin(angle);
  }

 private:
  std::vector<double> centre_ = {0, 0, 0};
  std::string plane_ = "xy";
  std::vector<double> radius_ = {0, 1};
  std::vector<double> angle_ = {-3.141592653589793, 3.141592653589793};
};
const RegisteredTerm<GoalTerm, Ring> kRing(
    "ring", "anywhere between two radii (m) and two angles (rad), drawn for each episode");

/// What a site and a goal have to do with one another.
class SiteAndGoal {
 protected:
  void bindBoth(TermSettings& settings) {
    settings.bind("site", site_, "that is to go there");
    settings.bind("goal", goal_, "which of environment.goals");
  }
  void findBoth(const Elements& elements) {
    site_index_ = elements.one(Element::kSite, "site", site_);
    goal_index_ = elements.goal("goal", goal_);
  }
  // from the site to the goal
  void offset(const Robot& robot, double* three) const {
    mju_sub3(three, robot.goal(goal_index_), robot.data->site_xpos + 3 * site_index_);
  }
  double distance(const Robot& robot) const {
    return mju_dist3(robot.goal(goal_index_), robot.data->site_xpos + 3 * site_index_);
  }
  std::string goal_;

 private:
  std::string site_;
  int site_index_ = 0;
  int goal_index_ = 0;
};

class GoalPosition : public ObservationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("goal", goal_, "which of environment.goals");
    settings.bind("axes", axes_, "of the world, which to observe", {"x", "y", "z"});
  }
  void find(const Elements& elements) override { index_ = elements.goal("goal", goal_); }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& axis : axes_) quantities.push_back({goal_ + "_" + axis, "m"});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    for (const std::string& axis : axes_) *numbers++ = robot.goal(index_)[axis[0] - 'x'];
  }

 private:
  std::string goal_;
  std::vector<std::string> axes_ = {"x", "y", "z"};
  int index_ = 0;
};
const RegisteredTerm<ObservationTerm, GoalPosition> kGoalPosition("goal_position",
                                                                  "where a goal is, m, world axes");

class GoalOffset : public ObservationTerm, SiteAndGoal {
 public:
  void bind(TermSettings& settings) override {
    bindBoth(settings);
    settings.bind("axes", axes_, "of the world, which to observe", {"x", "y", "z"});
  }
  void find(const Elements& elements) override { findBoth(elements); }
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities;
    for (const std::string& axis : axes_) quantities.push_back({"to_" + goal_ + "_" + axis, "m"});
    return quantities;
  }
  void observe(const Robot& robot, double* numbers) const override {
    double three[3];
    offset(robot, three);
    for (const std::string& axis : axes_) *numbers++ = three[axis[0] - 'x'];
  }

 private:
  std::vector<std::string> axes_ = {"x", "y", "z"};
};
const RegisteredTerm<ObservationTerm, GoalOffset> kGoalOffset("goal_offset",
                                                              "from a site to a goal, m");

class GoalDistance : public RewardTerm, SiteAndGoal {
 public:
  void bind(TermSettings& settings) override { bindBoth(settings); }
  void find(const Elements& elements) override { findBoth(elements); }
  double value(const Robot& robot, const double*) const override { return distance(robot); }
};
const RegisteredTerm<RewardTerm, GoalDistance> kGoalDistance(
    "goal_distance", "of a site from a goal, m: give it a weight below 0");

class GoalVelocity : public RewardTerm, SiteAndGoal {
 public:
  void bind(TermSettings& settings) override { bindBoth(settings); }
  void find(const Elements& elements) override { findBoth(elements); }
  int memory() const override { return 1; }
  void remember(const Robot& robot, double* memory) const override { *memory = distance(robot); }
  double value(const Robot& robot, const double* memory) const override {
    return (*memory - distance(robot)) / robot.dt;
  }
};
const RegisteredTerm<RewardTerm, GoalVelocity> kGoalVelocity(
    "goal_velocity", "how fast a site nears a goal, m/s, mean over the step");

class GoalReached : public RewardTerm, SiteAndGoal {
 public:
  void bind(TermSettings& settings) override {
    bindBoth(settings);
    settings.bind("within", within_, "this distance counts as there, m", Range::above(0));
    settings.bind("at_end", at_end_, "only the horizon's last step counts");
  }
  void find(const Elements& elements) override { findBoth(elements); }
  double value(const Robot& robot, const double*) const override {
    return (!at_end_ || robot.last_step) && distance(robot) <= within_ ? 1 : 0;
  }

 private:
  double within_ = 0.05;
  bool at_end_ = false;
};
const RegisteredTerm<RewardTerm, GoalReached> kGoalReached(
    "goal_reached", "1 where a site is within a distance (m) of a goal, else 0");

class EndsAtGoal : public TerminationTerm, SiteAndGoal {
 public:
  void bind(TermSettings& settings) override {
    bindBoth(settings);
    settings.bind("within", within_, "this distance counts as there, m", Range::above(0));
  }
  void find(const Elements& elements) override { findBoth(elements); }
  bool isOver(const Robot& robot) const override { return distance(robot) <= within_; }

 private:
  double within_ = 0.05;
};
const RegisteredTerm<TerminationTerm, EndsAtGoal> kEndsAtGoal(
    "goal_reached", "a site is within a distance (m) of a goal");

}  // namespace
}  // namespace pmeta
