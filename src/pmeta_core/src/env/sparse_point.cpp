#include "pmeta_core/env/sparse_point.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/number.h"
#include "pmeta_core/env/task_split.h"

namespace pmeta {
namespace {

const RegisteredFamily<SparsePointFamily> kSparsePoint("sparse_point_robot");

constexpr char kName[] = "sparse_point_robot";
constexpr double kLongestMove = 0.1;  ///< along each axis
constexpr double kPi = 3.141592653589793;

// `count` angles from 0 to pi; a single one lies in the middle
std::vector<double> evenAngles(int count) {
  if (count == 1) return {kPi / 2};
  std::vector<double> angles;
  for (int k = 0; k < count; ++k) angles.push_back(k * kPi / (count - 1));
  return angles;
}

EnvSpec sparsePointSpec(int horizon) {
  const double farthest = kLongestMove * horizon;
  EnvSpec spec = describedSpec(kName, horizon,
                               {{"x", "", -farthest, farthest}, {"y", "", -farthest, farthest}},
                               {{"move_x", "", -1, 1}, {"move_y", "", -1, 1}});
  spec.restorable = true;
  return spec;
}

}  // namespace

SparsePoint::SparsePoint(const SparsePointTask& task, double goal_radius, int horizon)
    : task_(task), goal_radius_(goal_radius), spec_(sparsePointSpec(horizon)) {}

void SparsePoint::reset(Rng&, double* observation) {
  x_ = 0;
  y_ = 0;
  steps_ = 0;
  observation[0] = x_;
  observation[1] = y_;
}

Step SparsePoint::step(const double* action, Rng&, double* observation) {
  ++steps_;
  for (int i = 0; i < 2; ++i) {
    if (std::isfinite(action[i])) continue;
    throw Error(std::string(kName) + ", step " + std::to_string(steps_) + ": action[" +
                std::to_string(i) + "] is not finite.");
  }
  x_ += kLongestMove * std::clamp(action[0], -1.0, 1.0);
  y_ += kLongestMove * std::clamp(action[1], -1.0, 1.0);
  observation[0] = x_;
  observation[1] = y_;
  const double dx = x_ - task_.goal_x;
  const double dy = y_ - task_.goal_y;
  const double distance = std::sqrt(dx * dx + dy * dy);
  return {-distance, false, steps_ >= spec_.horizon, distance <= goal_radius_ ? 1 - distance : 0};
}

std::vector<double> SparsePoint::state() const { return {x_, y_, static_cast<double>(steps_)}; }

void SparsePoint::setState(const std::vector<double>& state) {
  requireState(spec_, state, 3);
  x_ = state[0];
  y_ = state[1];
  steps_ = static_cast<int>(state[2]);
}

void SparsePointFamily::bind(Settings& settings) {
  const Range angle = Range::between(-2 * kPi, 2 * kPi);
  settings.bind("environment.goal_angles", goal_angles_,
                "where each training task's goal lies on the unit circle, rad; [] spaces them "
                "evenly from 0 to pi",
                angle, Empty::kAllowed);
  settings.bind("environment.test_goal_angles", test_goal_angles_,
                "the same for each test task; [] draws them from 0 to pi", angle, Empty::kAllowed);
  settings.bind("environment.train_tasks", train_tasks_, "training tasks where goal_angles is []",
                Range::between(1, 10000));
  settings.bind("environment.test_tasks", test_tasks_,
                "test tasks that are drawn where test_goal_angles is []", Range::between(0, 10000));
  settings.bind("environment.goal_radius", goal_radius_,
                "within this distance of the goal the sparse reward is not 0",
                Range{0, 1, true, false});
  settings.bind("environment.horizon", horizon_, "steps after which an episode is truncated",
                Range::between(1, 1e6));
}

void SparsePointFamily::build(std::uint64_t seed) {
  std::vector<double> angles = goal_angles_.empty() ? evenAngles(train_tasks_) : goal_angles_;
  num_train_ = static_cast<int>(angles.size());
  const std::vector<double> test =
      givenOrDrawn(test_goal_angles_, test_tasks_, seed, Stream::kTestTaskDraw,
                   [](Rng& rng) { return kPi * rng.uniform(); });
  angles.insert(angles.end(), test.begin(), test.end());
  tasks_.clear();
  for (const double a : angles) tasks_.push_back({a, {std::cos(a), std::sin(a)}});
}

std::string SparsePointFamily::taskName(int task) const {
  return splitTaskName(kName, task, num_train_);
}

std::string SparsePointFamily::taskDescription(int task) const {
  const Task& t = tasks_.at(task);
  const NumbersWithDots dots;
  char text[80];
  std::snprintf(text, sizeof text, "goal at (%.3f, %.3f), angle %.4g rad", t.goal.goal_x,
                t.goal.goal_y, t.angle);
  return text;
}

std::unique_ptr<Env> SparsePointFamily::create(int task) const {
  return std::make_unique<SparsePoint>(tasks_.at(task).goal, goal_radius_, horizon_);
}

}  // namespace pmeta
