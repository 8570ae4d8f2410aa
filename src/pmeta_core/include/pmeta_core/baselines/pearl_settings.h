#pragma once

#include <string>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/sac_settings.h"

namespace pmeta {

/// Settings of PEARL; the defaults are small ones, for one core. Of `sac` those apply that are
/// bound below; updateSettings() sets the others.
struct PearlSettings {
  PearlSettings();

  SacSettings sac;                   ///< of networks, update and context
  double learning_rate = 1e-3;       ///< Adam's, of all networks
  int meta_batch = 4;                ///< tasks of one update, drawn with repetition
  int task_batch = 64;               ///< transitions of each in it
  int warm_up_steps = 2000;          ///< by the first policy, on each task
  int tasks_per_iteration = 2;       ///< drawn with repetition
  int prior_steps = 400;             ///< on each of those, on z from the prior
  int posterior_steps = 600;         ///< then, on z from q(z|c)
  int updates_per_iteration = 1000;  ///< after those steps
  int buffer_size = 0;  ///< transitions that each task's replay holds; 0: all of the run
};

/// Binds all of them below `prefix`, e.g. "pearl.".
void bind(Settings& settings, const std::string& prefix, PearlSettings& pearl);

/// Throws Error on settings that do not go together, or not with so many training tasks.
void check(const PearlSettings& pearl, int num_tasks);

/// What one update of meta_batch tasks is, as SacUpdate takes it.
SacSettings updateSettings(const PearlSettings& pearl, int horizon);

}  // namespace pmeta
