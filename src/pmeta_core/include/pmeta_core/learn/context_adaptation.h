#pragma once

#include <cstdint>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_networks.h"

namespace pmeta {

/// What some episodes of exploration told of a task.
struct Adaptation {
  LatentPosterior posterior;    ///< q(z|c) of all their transitions
  std::vector<float> before;    ///< z to act with before them: the prior's mean, 0
  std::vector<float> after;     ///< z to act with after them: the posterior's mean
  std::vector<double> returns;  ///< of each episode, by Step::evaluatedReward(), undiscounted
  std::int64_t env_steps = 0;   ///< transitions they took
};

/// Adapts to the task of `env` as at PEARL's test time: settings.exploration_episodes episodes, the
/// first with z drawn from the prior, each later one with z drawn from the posterior of all before.
/// They act by tanh(mean), or by samples of the policy with settings.exploration_noise.
/// `parameters` (personal or meta) stay as they are; `networks` must have an encoder.
Adaptation adapt(const SacNetworks& networks, const ContextSettings& settings,
                 const float* parameters, Env& env, Rng& rng);

}  // namespace pmeta
