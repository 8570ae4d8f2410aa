#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/env/tabular_env.h"

namespace pmeta {

/// Action values, row-major: entry (state, action) at state * num_actions + action.
using QTable = std::vector<double>;

/// Return of a policy on one task.
struct ReturnStats {
  double mean = 0;
  double std = 0;    ///< standard deviation over episodes (population)
  int episodes = 0;  ///< episodes, or start states where the average is exact
  int broken_episodes =
      0;  ///< whose simulation broke down: they count with their return until then
};

/// The action of the largest value; the lowest index wins a tie.
int greedyAction(const double* action_values, int num_actions);

/// r(s,a) + gamma * E max_a' Q(s',a'), the Bellman optimality backup of one entry (paper, Section
/// "Personalized Multi-task Value Iteration"), by the known model.
double bellmanBackup(const TabularEnv& env, const QTable& q, int state, int action, double gamma);

/// Expected undiscounted return of the greedy policy of `q`, by dynamic programming over
/// spec().horizon steps; mean and deviation over all owned states as starts. No sampling.
ReturnStats evaluateGreedy(const TabularEnv& env, const QTable& q);

/// The same for the best policy of the finite horizon: the ceiling of any return.
ReturnStats optimalReturn(const TabularEnv& env);

}  // namespace pmeta
