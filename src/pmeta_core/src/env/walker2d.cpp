#include "pmeta_core/env/walker2d.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/env/task_split.h"

namespace pmeta {
namespace {

constexpr char kName[] = "walker_2d_params";
constexpr int kFrameSkip = 4;
constexpr double kControlCost = 0.001;
constexpr double kLowest = 0.8;
constexpr double kHighest = 2;
constexpr double kSteepest = 1;
constexpr double kHighestSpeed = 10;
constexpr double kStartSpread = 0.005;

}  // namespace

const MujocoLayout& Walker2d::layout() {
  static const MujocoLayout kLayout = {
      "walker2d",
      9,
      9,
      {"torso", "thigh", "leg", "foot", "thigh_left", "leg_left", "foot_left"},
      {"root_x", "root_z", "root_pitch", "thigh", "leg", "foot", "thigh_left", "leg_left",
       "foot_left"},
      {"thigh", "leg", "foot", "thigh_left", "leg_left", "foot_left"}};
  return kLayout;
}

std::vector<Quantity> Walker2d::observed() {
  std::vector<Quantity> velocities = joined(
      {{{"root_x_velocity", "m/s"}, {"root_z_velocity", "m/s"}}, jointVelocities(layout(), 2)});
  for (Quantity& one : velocities) {
    one.low = -kHighestSpeed;
    one.high = kHighestSpeed;
  }
  return joined({{{"root_z", "m", kLowest, kHighest}, {"root_pitch", "rad", -kSteepest, kSteepest}},
                 jointAngles(layout(), 3),
                 velocities});
}

Walker2d::Walker2d(std::shared_ptr<const MujocoModel> model, int horizon)
    : MujocoEnv(kName, layout(), observed(), horizon, std::move(model), kFrameSkip) {}

void Walker2d::drawStart(Rng& rng, double* qpos, double* qvel) {
  for (int i = 0; i < simulation_.nq(); ++i) qpos[i] += kStartSpread * (2 * rng.uniform() - 1);
  for (int i = 0; i < simulation_.nv(); ++i) qvel[i] += kStartSpread * (2 * rng.uniform() - 1);
}

void Walker2d::beforeStep() { x_before_ = simulation_.qpos()[0]; }

Step Walker2d::afterStep() {
  forward_velocity_ = (simulation_.qpos()[0] - x_before_) / simulation_.dt();
  control_cost_ = kControlCost * squaredControl();
  const double height = simulation_.qpos()[1];
  const double pitch = simulation_.qpos()[2];
  const bool upright = height > kLowest && height < kHighest && std::abs(pitch) < kSteepest;
  return {forward_velocity_ + aliveBonus() - control_cost_, !upright};
}

void Walker2d::observe(double* observation) const {
  observation = std::copy(simulation_.qpos() + 1, simulation_.qpos() + 9, observation);
  std::transform(simulation_.qvel(), simulation_.qvel() + 9, observation,
                 [](double x) { return std::clamp(x, -kHighestSpeed, kHighestSpeed); });
}

void Walker2dParamsFamily::bind(Settings& settings) {
  settings.bind("environment.task_seeds", task_seeds_,
                "seed of each training task's model; [] derives them from the experiment's seed",
                Range::atLeast(0), Empty::kAllowed);
  settings.bind("environment.test_task_seeds", test_task_seeds_, "the same for each test task",
                Range::atLeast(0), Empty::kAllowed);
  settings.bind("environment.train_tasks", train_tasks_,
                "training tasks that are drawn where task_seeds is []", Range::between(1, 10000));
  settings.bind("environment.test_tasks", test_tasks_,
                "test tasks that are drawn where test_task_seeds is []", Range::between(0, 10000));
  mujoco_.bind(settings);
}

void Walker2dParamsFamily::build(std::uint64_t seed) {
  base_ = mujoco_.open(Walker2d::layout());
  const auto draw = [](Rng& rng) { return static_cast<int>(rng.below(1000000000)); };
  std::vector<int> seeds = givenOrDrawn(task_seeds_, train_tasks_, seed, Stream::kTaskDraw, draw);
  num_train_ = static_cast<int>(seeds.size());
  const std::vector<int> test =
      givenOrDrawn(test_task_seeds_, test_tasks_, seed, Stream::kTestTaskDraw, draw);
  seeds.insert(seeds.end(), test.begin(), test.end());
  tasks_.clear();
  for (const int one : seeds) {
    Rng rng(static_cast<std::uint64_t>(one), 0, Stream::kTaskDraw);
    Walker2dTask factors = drawWalker2dTask(*base_, rng);
    auto model = applyWalker2dTask(*base_, factors);
    tasks_.push_back({one, std::move(factors), std::move(model)});
  }
}

std::string Walker2dParamsFamily::taskName(int task) const {
  return splitTaskName(kName, task, num_train_);
}

std::string Walker2dParamsFamily::taskDescription(int task) const {
  const Task& t = tasks_.at(task);
  return "model of task_seed " + std::to_string(t.seed) + ": " +
         describeWalker2dModel(*t.model, *base_);
}

std::unique_ptr<Env> Walker2dParamsFamily::create(int task) const {
  return std::make_unique<Walker2d>(tasks_.at(task).model, mujoco_.horizon);
}

}  // namespace pmeta
