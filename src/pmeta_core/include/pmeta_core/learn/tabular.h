#pragma once

#include "pmeta_core/act/episode.h"
#include "pmeta_core/act/table_policies.h"
#include "pmeta_core/env/tabular_env.h"

namespace pmeta {

/// r(s,a) + gamma * E max_a' Q(s',a'), the Bellman optimality backup of one entry (paper, Section
/// "Personalized Multi-task Value Iteration"), by the known model.
double bellmanBackup(const TabularEnv& env, const QTable& q, int state, int action, double gamma);

/// Expected undiscounted return of the greedy policy of `q`, by dynamic programming over
/// spec().horizon steps; mean and deviation over all owned states as starts. No sampling.
ReturnStats evaluateGreedy(const TabularEnv& env, const QTable& q);

/// The same for the best policy of the finite horizon: the ceiling of any return.
ReturnStats optimalReturn(const TabularEnv& env);

}  // namespace pmeta
