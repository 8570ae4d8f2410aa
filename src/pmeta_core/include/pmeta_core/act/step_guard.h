#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// Steps environments and holds what they give against what they must: finite rewards, and as many
/// finite numbers of observation as their spec says. What does not, and what they throw, is thrown
/// as FaultyEnv, but for BrokenEpisode. Whatever comes of an action that is no number itself is let
/// pass: then it is the policy that has diverged.
class StepGuard {
 public:
  /// `observation_size`, `action_size`: of all environments that it is used for.
  StepGuard(std::size_t observation_size, std::size_t action_size);

  void reset(Env& env, Rng& rng, double* observation);                       ///< as Env::reset()
  Step step(Env& env, const double* action, Rng& rng, double* observation);  ///< as Env::step()

 private:
  void prepare();
  void take(const Env& env, double* observation) const;

  std::size_t size_, action_size_;
  std::vector<double> written_;  // an observation, and room behind it for what is too much
};

}  // namespace pmeta
