#include "pmeta_core/learn/q_learner.h"

#include <algorithm>
#include <cmath>

namespace pmeta {

QLearner::QLearner(const TabularEnv& env, double gamma) : env_(env), gamma_(gamma) {}

QLearner::BatchStats QLearner::learnBatch(const QTable& q, double samples_per_entry,
                                          Optimizer<double>& optimizer, Rng& rng) const {
  const int n = env_.numActions();
  const std::vector<int>& states = env_.ownedStates();
  BatchStats stats;
  stats.samples =
      std::max(1LL, std::llround(samples_per_entry * static_cast<double>(states.size()) * n));
  for (std::int64_t i = 0; i < stats.samples; ++i) {
    const int s = states[rng.below(states.size())];
    const int a = static_cast<int>(rng.below(n));
    const Outcome& outcome = env_.sample(s, a, rng);
    const double* next = &q[static_cast<std::size_t>(outcome.next_state) * n];
    const double target =
        outcome.reward + (outcome.terminated ? 0.0 : gamma_ * *std::max_element(next, next + n));
    const std::size_t entry = static_cast<std::size_t>(s) * n + a;
    const double gradient = q[entry] - target;
    stats.mean_abs_td_error += std::abs(gradient);
    optimizer.apply(entry, &gradient, 1);
  }
  stats.mean_abs_td_error /= static_cast<double>(stats.samples);
  return stats;
}

}  // namespace pmeta
