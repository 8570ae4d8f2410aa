#include "pmeta_core/learn/tabular.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pmeta {
namespace {

// expected return to go of acting now, given the values one step later
double lookahead(const TabularEnv& env, const std::vector<double>& later, int state, int action) {
  double sum = 0;
  for (const Outcome& outcome : env.outcomes(state, action)) {
    sum += outcome.probability *
           (outcome.reward + (outcome.terminated ? 0.0 : later[outcome.next_state]));
  }
  return sum;
}

ReturnStats overStarts(const TabularEnv& env, const std::vector<double>& values) {
  const std::vector<int>& starts = env.ownedStates();
  ReturnStats stats;
  stats.episodes = static_cast<int>(starts.size());
  for (const int s : starts) stats.mean += values[s];
  stats.mean /= stats.episodes;
  double squares = 0;
  for (const int s : starts) squares += (values[s] - stats.mean) * (values[s] - stats.mean);
  stats.std = std::sqrt(squares / stats.episodes);
  return stats;
}

}  // namespace

double bellmanBackup(const TabularEnv& env, const QTable& q, int state, int action, double gamma) {
  const int n = env.numActions();
  double sum = 0;
  for (const Outcome& outcome : env.outcomes(state, action)) {
    const double* next = &q[static_cast<std::size_t>(outcome.next_state) * n];
    const double future = outcome.terminated ? 0.0 : gamma * *std::max_element(next, next + n);
    sum += outcome.probability * (outcome.reward + future);
  }
  return sum;
}

ReturnStats evaluateGreedy(const TabularEnv& env, const QTable& q) {
  const int n = env.numActions();
  std::vector<double> now(env.numStates(), 0.0);
  std::vector<double> later(env.numStates(), 0.0);
  for (int step = 0; step < env.spec().horizon; ++step) {
    now.swap(later);
    for (const int s : env.ownedStates()) {
      now[s] = lookahead(env, later, s, greedyAction(&q[static_cast<std::size_t>(s) * n], n));
    }
  }
  return overStarts(env, now);
}

ReturnStats optimalReturn(const TabularEnv& env) {
  std::vector<double> now(env.numStates(), 0.0);
  std::vector<double> later(env.numStates(), 0.0);
  for (int step = 0; step < env.spec().horizon; ++step) {
    now.swap(later);
    for (const int s : env.ownedStates()) {
      double best = -std::numeric_limits<double>::infinity();
      for (int a = 0; a < env.numActions(); ++a) {
        best = std::max(best, lookahead(env, later, s, a));
      }
      now[s] = best;
    }
  }
  return overStarts(env, now);
}

}  // namespace pmeta
