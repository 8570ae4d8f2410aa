#pragma once

#include <functional>
#include <string>

#include "pmeta_core/base/registry.h"
#include "pmeta_core/experiment/experiment_settings.h"
#include "pmeta_core/personal/learner_kind.h"

namespace pmeta {

/// What a robot's agent sends at the end of its round.
enum class Sent {
  kAuxiliary,  ///< omega
  kPersonal,   ///< phi
};

/// How agents and meta-aggregator work together: the algorithms are settings of one run, not code
/// paths of their own.
struct Algorithm {
  std::string label;            ///< for figures and tables, e.g. "pMeta-RL"
  std::string meaning;          ///< a clause, for the list of settings
  Sent sent = Sent::kPersonal;  ///< omega only where there is a pull that makes it another than phi
  /// Are the personal parameters pulled towards the auxiliary ones? If not, lambda is 0.
  bool pulls = false;
  /// Does the aggregate come back as each round's start? If not, agents keep what they have, beta
  /// is 0, and no meta-policy is evaluated.
  bool shares = true;
  /// Does each agent train in environments of all tasks, as if trajectories were shared?
  bool pools_environments = false;
  /// Throws Error on settings that do not go with it; may be empty.
  std::function<void(const ExperimentSettings& settings, const LearnerKind& learner, int num_tasks)>
      check = {};
};

/// Every algorithm, by the name that `algorithm` gives.
Registry<Algorithm>& algorithms();

}  // namespace pmeta
