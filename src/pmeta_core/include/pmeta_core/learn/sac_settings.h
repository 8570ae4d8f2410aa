#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/temperature.h"

namespace pmeta {

/// Settings of soft actor-critic.
struct SacSettings {
  std::vector<int> hidden = {512, 512};  ///< units of each hidden layer of actor and critics
  int batch_size = 256;                  ///< transitions of one update
  int buffer_size = 100000;              ///< transitions the replay holds
  double gamma = 0.99;                   ///< discount
  double tau = 0.005;                    ///< Polyak step of the target critics
  double reward_scale = 1;               ///< factor on rewards in the critics' target
  int warm_up_steps = 1000;              ///< uniformly random steps before the first update
  int env_steps_per_update = 1;          ///< environment steps before each update
  TemperatureSettings temperature;       ///< weight of the entropy
  /// What tells the networks the task besides the observation: "inference" (a latent vector that
  /// the context encoder infers), "one_hot" (the task's number), or "none".
  std::string task_encoding = "one_hot";
  ContextSettings context;      ///< with task_encoding "inference"
  int evaluation_episodes = 5;  ///< episodes of one evaluation, by tanh(mean)
  bool portable = false;        ///< see MlpSpec; set by the experiment's `arithmetic`

  // what a round does besides resetting parameters
  std::string targets_at_round = "keep";  ///< target critics: "keep", or "meta": the meta-policy's
  bool reset_moments = false;             ///< Adam's moments begin anew
  /// With one_hot: the first layers' column of a task's own entry is that task's alone, and
  /// aggregation takes it from there.
  bool own_column = true;
};

/// Binds all of them below `prefix`, e.g. "sac.".
void bind(Settings& settings, const std::string& prefix, SacSettings& sac);

}  // namespace pmeta
