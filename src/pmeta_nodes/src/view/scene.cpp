#include "pmeta_nodes/scene.h"

#include <algorithm>
#include <cmath>

#include "view/robot_scene.h"
#include "view/trace_scene.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;

namespace {

constexpr std::size_t kMostSteps = 100000;

}  // namespace

pmeta::Registry<SceneMaker>& scenes() {
  static pmeta::Registry<SceneMaker> scenes("scene");
  return scenes;
}

std::unique_ptr<Scene> makeScene(const pmeta::Experiment& experiment) {
  const pmeta::EnvFamily& family = experiment.family();
  const int num_tasks = experiment.totalTasks();
  if (const SceneMaker* make = scenes().find(experiment.settings().environment)) {
    return (*make)(family, num_tasks);
  }
  if (family.make(0)->model() != nullptr) return std::make_unique<RobotScene>(family, num_tasks);
  return std::make_unique<TraceScene>(family, num_tasks);
}

std::size_t numSteps(const Trajectory& trajectory) { return trajectory.rewards.size(); }

std::size_t stepAt(const Trajectory& trajectory, double seconds, double step_seconds) {
  constexpr double kRounding = 1e-9;
  const double step = std::floor(std::max(seconds, 0.0) / step_seconds + kRounding);
  return static_cast<std::size_t>(std::min(step, static_cast<double>(numSteps(trajectory))));
}

std::vector<std::size_t> thinnedSteps(std::size_t last, std::size_t most) {
  const std::size_t stride = std::max<std::size_t>((last + most - 1) / most, 1);
  std::vector<std::size_t> steps;
  for (std::size_t step = 0; step < last; step += stride) steps.push_back(step);
  steps.push_back(last);
  return steps;
}

std::string formProblem(const Trajectory& trajectory, std::size_t observation_size) {
  if (trajectory.policy != Trajectory::PERSONAL && trajectory.policy != Trajectory::META) {
    return "policy " + std::to_string(trajectory.policy) + " is neither personal nor meta.";
  }
  const std::size_t steps = numSteps(trajectory);
  if (steps > kMostSteps) {
    return "it has " + std::to_string(steps) + " steps; at most " + std::to_string(kMostSteps) +
           " are shown.";
  }
  if (trajectory.observation_size != observation_size ||
      trajectory.observations.size() != (steps + 1) * observation_size) {
    return "it has " + std::to_string(trajectory.observations.size()) + " observations of size " +
           std::to_string(trajectory.observation_size) + " for " + std::to_string(steps) +
           " steps; they must be of size " + std::to_string(observation_size) + ".";
  }
  if (trajectory.actions.size() != steps * trajectory.action_size) {
    return "it has " + std::to_string(trajectory.actions.size()) + " actions for " +
           std::to_string(steps) + " steps.";
  }
  for (const auto* values : {&trajectory.observations, &trajectory.positions}) {
    for (const double value : *values) {
      if (!std::isfinite(value)) return "it holds a number that is not finite.";
    }
  }
  return "";
}

}  // namespace pmeta_nodes
