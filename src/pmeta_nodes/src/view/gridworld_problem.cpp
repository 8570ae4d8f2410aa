// Which messages are no episode on a grid.
#include <cmath>

#include "view/gridworld_scene.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;

std::string trajectoryProblem(const Trajectory& trajectory, const GridGeometry& grid) {
  if (trajectory.policy != Trajectory::PERSONAL && trajectory.policy != Trajectory::META) {
    return "policy " + std::to_string(trajectory.policy) + " is neither personal nor meta.";
  }
  if (trajectory.observation_size != 2 || trajectory.observations.size() < 2 ||
      trajectory.observations.size() % 2 != 0) {
    return "it has " + std::to_string(trajectory.observations.size()) + " observations of size " +
           std::to_string(trajectory.observation_size) + "; a gridworld's are (row, column).";
  }
  const std::size_t steps = trajectory.observations.size() / 2 - 1;
  if (trajectory.rewards.size() != steps ||
      trajectory.actions.size() != steps * trajectory.action_size) {
    return "it has " + std::to_string(trajectory.actions.size()) + " actions and " +
           std::to_string(trajectory.rewards.size()) + " rewards for " + std::to_string(steps) +
           " steps.";
  }
  const double last = grid.task.size - 1;
  for (std::size_t i = 0; i < trajectory.observations.size(); ++i) {
    // written so that NaN fails, too
    const double at = trajectory.observations[i];
    if (!(at >= 0 && at <= last && at == std::floor(at))) {
      return "observation " + std::to_string(at) + " is not a cell of a grid with " +
             std::to_string(grid.task.size) + " cells along each side.";
    }
    if (i % 2 == 1 && i > 2) {
      const double moved =
          std::abs(at - trajectory.observations[i - 2]) +
          std::abs(trajectory.observations[i - 1] - trajectory.observations[i - 3]);
      if (moved > 1) return "step " + std::to_string(i / 2) + " moves more than one cell.";
    }
  }
  const std::size_t states = static_cast<std::size_t>(grid.stride) * grid.stride;
  for (const std::size_t size :
       {trajectory.state_values.size(), trajectory.greedy_actions.size()}) {
    if (size != 0 && size != states) {
      return "it has a table of " + std::to_string(size) + " states instead of " +
             std::to_string(states) + ".";
    }
  }
  for (const int action : trajectory.greedy_actions) {
    if (action < -1 || action > 3) return "there is no action " + std::to_string(action) + ".";
  }
  return "";
}

}  // namespace pmeta_nodes
