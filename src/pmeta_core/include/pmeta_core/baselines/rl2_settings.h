#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/baselines/ppo.h"

namespace pmeta {

/// Settings of RL². The defaults are VariBAD's for its RL² baseline (Zintgraf et al., 2020), but
/// for trials of three episodes.
struct Rl2Settings {
  int hidden = 128;                           ///< units of the recurrent network
  std::vector<int> head = {128};              ///< tanh units between it and mean or value
  std::string initialisation = "orthogonal";  ///< of weights: "orthogonal" or "glorot"
  double initial_log_std = 0;                 ///< of u, at the start
  int trials = 16;                            ///< of one iteration, over all tasks
  int episodes = 3;                           ///< of one trial
  double gamma = 0.97;                        ///< discount, over the whole trial
  double gae_lambda = 0.9;                    ///< of advantages, over the whole trial
  std::string baseline = "value";             ///< of advantages: "value" (the critic) or "linear"
  bool scale_rewards = true;                  ///< by the running deviation of the discounted return
  double learning_rate = 7e-4;                ///< Adam's
  int epochs = 2;                             ///< over the trials of one iteration
  int minibatches = 4;                        ///< of whole trials, in one epoch
  double max_gradient_norm = 0.5;             ///< longer gradients are cut to it
  PpoSettings ppo;                            ///< of the loss
  std::vector<int> exploration_episodes = {1, 2};  ///< it is evaluated after each; ascending
  int evaluation_episodes = 5;                     ///< of one evaluation
  bool portable = false;  ///< see MlpSpec; set by the experiment's `arithmetic`
};

/// Binds all of them below `prefix`, e.g. "rl2.".
void bind(Settings& settings, const std::string& prefix, Rl2Settings& rl2);

/// Throws Error where they do not go together.
void check(const Rl2Settings& settings);

}  // namespace pmeta
