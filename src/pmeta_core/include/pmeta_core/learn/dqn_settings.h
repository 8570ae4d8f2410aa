#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// Settings of deep Q-learning.
struct DqnSettings {
  std::vector<int> hidden = {512, 512};  ///< units of each hidden layer
  int batch_size = 64;                   ///< transitions of one update
  int buffer_size = 200000;              ///< transitions the replay holds
  double gamma = 0.99;                   ///< discount
  int n_step = 3;                        ///< rewards summed before bootstrapping
  bool double_q = false;                 ///< the online network chooses the action of the target
  bool dueling = false;                  ///< state value and advantages apart
  bool huber = false;                    ///< Huber loss with threshold 1 instead of the square
  int target_update_interval = 350;      ///< updates between copies to the target network
  int averaged_targets = 1;              ///< target networks whose mean is the target; 1: plain DQN
  double epsilon_start = 0.3;            ///< exploration rate at the first update
  double epsilon_finish = 0.01;          ///< exploration rate at the end of its slope
  double epsilon_fraction = 1;           ///< length of the slope as a share of all updates
  int num_envs = 10;                     ///< environments stepped in parallel
  int env_steps_per_update = 1;          ///< steps in each environment before an update
  int warm_up_steps = 64;                ///< random steps in each environment before the first
  bool bootstrap_at_limit = true;        ///< the horizon is no terminal state to the target
  double priority_alpha = 0.6;           ///< how far priorities count; 0: uniform replay
  double priority_beta = 0.4;            ///< how far importance weights correct for that
  int evaluation_episodes = 10;          ///< greedy episodes of one evaluation
  bool portable = false;                 ///< see MlpSpec; set by the experiment's `arithmetic`
};

/// Binds all of them below `prefix`, e.g. "dqn.".
void bind(Settings& settings, const std::string& prefix, DqnSettings& dqn);

/// Throws Error if the warm-up is too short for a single sample.
void requireSamples(const DqnSettings& dqn);

/// The Q-network that DqnLearner trains. Throws Error if actions are continuous.
MlpSpec dqnNetwork(const EnvSpec& env, const DqnSettings& settings);

}  // namespace pmeta
