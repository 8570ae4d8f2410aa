#pragma once

#include <vector>

#include "pmeta_core/act/evaluation.h"
#include "pmeta_core/adapt/adaptation.h"

namespace pmeta {

/// Return of a policy that was given some exploration episodes to find out about the task.
struct AdaptedReturn {
  int context_episodes = 0;               ///< how many; 0: before any
  ReturnStats stats;                      ///< over one episode in each evaluation environment
  std::vector<float> task_input = {};     ///< what it was told of the task then
  std::vector<double> task_weights = {};  ///< see Adaptation::taskWeights()
};

/// Returns on the task of `evaluation` as at test time: before exploration, and after each of
/// `counts` exploration episodes, which are ascending. All evaluations start alike; what is known
/// in the end stays in `adaptation`.
std::vector<AdaptedReturn> evaluateAdapted(Evaluation& evaluation, Adaptation& adaptation,
                                           const std::vector<int>& counts, Rng& rng);

}  // namespace pmeta
