#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/sac_settings.h"

namespace pmeta {

/// Settings of MetaCURE; the defaults are small ones, for one core. Of `sac` those apply that are
/// bound below; exploiterSettings() and explorerSettings() set the others.
struct MetaCureSettings {
  /// The defaults.
  MetaCureSettings();

  SacSettings sac;                   ///< of exploiter and explorer alike
  double learning_rate = 1e-3;       ///< Adam's, of all networks
  int latent_size = 5;               ///< length of z
  int recurrent_units = 64;          ///< of the encoder
  double kl_weight = 0.1;            ///< of KL(belief || N(0, I))
  double gain_weight = 0.1;          ///< of the explorer's intrinsic reward
  bool predicts_next = false;        ///< also the next observation; for tasks that differ in that
  std::string pairing = "trial";     ///< what the explorer learns from: see MetaCure
  int meta_batch = 4;                ///< tasks of one update, drawn with repetition
  int task_batch = 64;               ///< transitions of each in it
  int trial_episodes = 2;            ///< of the explorer, in one trial
  int warm_up_steps = 2000;          ///< in trials, by the first explorer, on each task
  int tasks_per_iteration = 2;       ///< drawn with repetition
  int prior_steps = 200;             ///< on each of those, after a trial, on z from the prior
  int posterior_steps = 400;         ///< then, on z from the trial's last belief
  int updates_per_iteration = 1000;  ///< after those steps
  int buffer_size = 0;      ///< transitions that each task's replay holds; 0: all of the run
  int trial_buffer = 1000;  ///< trials that each task keeps
  std::vector<int> exploration_episodes = {2};  ///< it is evaluated after each; ascending
};

/// Binds all of them below `prefix`, e.g. "metacure.".
void bind(Settings& settings, const std::string& prefix, MetaCureSettings& cure);

/// Throws Error on settings that do not go together, or not with so many training tasks.
void check(const MetaCureSettings& cure, int num_tasks);

/// What one update of the exploiter is, as SacUpdate takes it: of meta_batch tasks.
SacSettings exploiterSettings(const MetaCureSettings& cure);
/// The same of the explorer, whose networks have names of their own.
SacSettings explorerSettings(const MetaCureSettings& cure);

}  // namespace pmeta
