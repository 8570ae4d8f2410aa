#pragma once

#include <cstdint>

#include "pmeta_core/env/tabular_env.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/learn/tabular.h"

namespace pmeta {

/// Q-learning on a table from transitions of a known model.
class QLearner {
 public:
  /// What one batch did.
  struct BatchStats {
    std::int64_t samples = 0;      ///< environment transitions drawn
    double mean_abs_td_error = 0;  ///< mean |r + gamma max Q(s',.) - Q(s,a)|
  };

  /// `env` must outlive the learner. gamma: discount in [0, 1).
  QLearner(const TabularEnv& env, double gamma);

  /// One personalised update's samples: round(samples_per_entry * owned states * actions)
  /// (at least one) transitions (s,a,r,s'), (s,a) uniform over the owned entries; each at once, in
  /// place, hands the gradient Q(s,a) - [r + gamma max Q(s',.)] of its entry to `optimizer`, which
  /// moves `q`.
  BatchStats learnBatch(const QTable& q, double samples_per_entry, Optimizer<double>& optimizer,
                        Rng& rng) const;

 private:
  const TabularEnv& env_;
  double gamma_;
};

}  // namespace pmeta
