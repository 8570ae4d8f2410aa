#pragma once

#include <cstdint>
#include <vector>

namespace pmeta {

/// Return of a policy on one task.
struct ReturnStats {
  double mean = 0;   ///< undiscounted, in units of reward
  double std = 0;    ///< standard deviation over episodes (population)
  int episodes = 0;  ///< episodes, or start states where the average is exact
  int broken_episodes =
      0;  ///< whose simulation broke down: they count with their return until then
};

/// One evaluation episode, for people to look at. Never part of what training exchanges.
struct Episode {
  int observation_size = 0;          ///< numbers of one observation
  int action_size = 0;               ///< numbers of one action
  std::vector<double> observations;  ///< (steps + 1) x observation_size, row-major
  std::vector<double> actions;       ///< steps x action_size, row-major
  std::vector<double> rewards;       ///< steps
  int position_size = 0;             ///< numbers of one configuration; 0: there are none
  std::vector<double> positions;     ///< (steps + 1) x position_size, see Env::configuration()
  /// How likely the policy took the task to be each of those trained on; see
  /// Adaptation::taskWeights().
  std::vector<double> task_weights;
  bool terminated = false;  ///< it ended in a terminal state
  bool truncated = false;   ///< it ended at the horizon, or where its simulation broke down
  std::vector<double> state_values;  ///< tabular tasks: max_a Q(s,a) by state, NaN where not owned
  std::vector<std::int32_t> greedy_actions;  ///< tabular tasks: argmax_a Q(s,a), -1 where not owned
  int action_grid = 0;  ///< actions along each axis of `action_values`; 0: there are none
  std::vector<float>
      action_values;  ///< two-dimensional actions: Q at the start, see actionValues()
};

}  // namespace pmeta
