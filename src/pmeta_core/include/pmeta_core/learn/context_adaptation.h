#pragma once

#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_networks.h"

namespace pmeta {

/// What a policy knows of a task after some episodes of exploration.
struct Adaptation {
  int episodes = 0;
  std::vector<float> latent;  ///< z to act with: the mean of q(z|c)
  int broken_episodes = 0;    ///< of those since the entry before: they broke down, and count until
                              ///< then
};

/// Adapts to the task of `env` as at PEARL's test time: explores with z drawn from the prior in the
/// first episode, and from the posterior of all transitions before in each later one. Gives what is
/// known after each of settings.exploration_episodes; before there is the prior's mean, 0.
///
/// Episodes act by tanh(mean), or by samples of the policy with settings.exploration_noise.
/// `parameters` (personal or meta) stay as they are. Throws Error if `networks` has no encoder.
std::vector<Adaptation> adapt(const SacNetworks& networks, const ContextSettings& settings,
                              const float* parameters, Env& env, Rng& rng);

}  // namespace pmeta
