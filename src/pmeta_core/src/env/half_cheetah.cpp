#include "pmeta_core/env/half_cheetah.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/task_split.h"

namespace pmeta {
namespace {

const RegisteredFamily<HalfCheetahDirFamily> kHalfCheetahDir("half_cheetah_dir");
const RegisteredFamily<HalfCheetahVelFamily> kHalfCheetahVel("half_cheetah_vel");

constexpr int kFrameSkip = 5;
constexpr double kControlCost = 0.05;
constexpr double kStartSpread = 0.1;
constexpr double kStartSpeed = 0.1;
constexpr double kHighestVelocity = 3;  ///< m/s, of the targets that are drawn

const char* nameOf(HalfCheetahTask::Goal goal) {
  return goal == HalfCheetahTask::Goal::kDirection ? "half_cheetah_dir" : "half_cheetah_vel";
}

}  // namespace

std::vector<Quantity> HalfCheetah::observed() {
  return joined({{{"root_z", "m"}, {"root_pitch", "rad"}},
                 jointAngles(layout(), 3),
                 {{"root_x_velocity", "m/s"}, {"root_z_velocity", "m/s"}},
                 jointVelocities(layout(), 2),
                 {{"torso_x", "m"}, {"torso_y", "m"}, {"torso_z", "m"}}});
}

const MujocoLayout& HalfCheetah::layout() {
  static const MujocoLayout kLayout = {
      "half_cheetah",
      9,
      9,
      {"torso", "bthigh", "bshin", "bfoot", "fthigh", "fshin", "ffoot"},
      {"root_x", "root_z", "root_pitch", "bthigh", "bshin", "bfoot", "fthigh", "fshin", "ffoot"},
      {"bthigh", "bshin", "bfoot", "fthigh", "fshin", "ffoot"}};
  return kLayout;
}

double HalfCheetah::reward(const HalfCheetahTask& task, double forward_velocity,
                           double control_cost) {
  return task.goal == HalfCheetahTask::Goal::kDirection
             ? task.value * forward_velocity - control_cost
             : -std::abs(forward_velocity - task.value) - control_cost;
}

HalfCheetah::HalfCheetah(const HalfCheetahTask& task, std::shared_ptr<const MujocoModel> model,
                         int horizon)
    : MujocoEnv(nameOf(task.goal), layout(), observed(), horizon, std::move(model), kFrameSkip),
      task_(task) {}

void HalfCheetah::drawStart(Rng& rng, double* qpos, double* qvel) {
  for (int i = 0; i < simulation_.nq(); ++i) qpos[i] += kStartSpread * (2 * rng.uniform() - 1);
  for (int i = 0; i < simulation_.nv(); ++i) qvel[i] += kStartSpeed * rng.normal();
}

void HalfCheetah::beforeStep() { x_before_ = simulation_.qpos()[0]; }

Step HalfCheetah::afterStep() {
  forward_velocity_ = (simulation_.qpos()[0] - x_before_) / simulation_.dt();
  control_cost_ = kControlCost * squaredControl();
  return {reward(task_, forward_velocity_, control_cost_)};
}

void HalfCheetah::observe(double* observation) const {
  observation = std::copy(simulation_.qpos() + 1, simulation_.qpos() + 9, observation);
  observation = std::copy(simulation_.qvel(), simulation_.qvel() + 9, observation);
  observation = std::copy(torso_, torso_ + 3, observation);
  std::transform(observation - 20, observation, observation - 20,
                 [](double x) { return static_cast<float>(x); });
}

void HalfCheetahFamily::build(HalfCheetahTask::Goal goal, const std::vector<double>& train,
                              const std::vector<double>& test) {
  model_ = mujoco_.open(HalfCheetah::layout());
  tasks_.clear();
  for (const double value : train) tasks_.push_back({goal, value});
  for (const double value : test) tasks_.push_back({goal, value});
  num_train_ = static_cast<int>(train.size());
}

std::string HalfCheetahFamily::taskName(int task) const {
  return splitTaskName(nameOf(tasks_.at(task).goal), task, num_train_);
}

std::unique_ptr<Env> HalfCheetahFamily::create(int task) const {
  return std::make_unique<HalfCheetah>(tasks_.at(task), model_, mujoco_.horizon);
}

void HalfCheetahDirFamily::bind(Settings& settings) {
  settings.bind("environment.directions", directions_,
                "1 (forward) or -1 (backward) for each training task", Range::between(-1, 1));
  settings.bind("environment.test_directions", test_directions_, "the same for each test task",
                Range::between(-1, 1), Empty::kAllowed);
  mujoco_.bind(settings);
}

void HalfCheetahDirFamily::build(std::uint64_t) {
  for (const auto& [key, directions] :
       {std::pair{"directions", &directions_}, std::pair{"test_directions", &test_directions_}}) {
    for (const double direction : *directions) {
      if (std::abs(direction) == 1) continue;
      throw Error(std::string("environment.") + key + " holds " + formatNumber(direction) +
                  " but must hold 1 (forward) and -1 (backward) only.");
    }
  }
  HalfCheetahFamily::build(HalfCheetahTask::Goal::kDirection, directions_, test_directions_);
}

std::string HalfCheetahDirFamily::taskDescription(int task) const {
  return this->task(task).value > 0 ? "run forward" : "run backward";
}

void HalfCheetahVelFamily::bind(Settings& settings) {
  const Range range = Range::between(-100, 100);
  settings.bind("environment.velocities", velocities_,
                "target velocity of each training task in m/s; [] draws them from 0 to 3", range,
                Empty::kAllowed);
  settings.bind("environment.test_velocities", test_velocities_, "the same for each test task",
                range, Empty::kAllowed);
  settings.bind("environment.train_tasks", train_tasks_,
                "training tasks that are drawn where velocities is []", Range::between(1, 10000));
  settings.bind("environment.test_tasks", test_tasks_,
                "test tasks that are drawn where test_velocities is []", Range::between(0, 10000));
  mujoco_.bind(settings);
}

void HalfCheetahVelFamily::build(std::uint64_t seed) {
  const auto draw = [](Rng& rng) { return kHighestVelocity * rng.uniform(); };
  HalfCheetahFamily::build(
      HalfCheetahTask::Goal::kVelocity,
      givenOrDrawn(velocities_, train_tasks_, seed, Stream::kTaskDraw, draw),
      givenOrDrawn(test_velocities_, test_tasks_, seed, Stream::kTestTaskDraw, draw));
}

std::string HalfCheetahVelFamily::taskDescription(int task) const {
  return "run at " + formatNumber(this->task(task).value) + " m/s";
}

}  // namespace pmeta
