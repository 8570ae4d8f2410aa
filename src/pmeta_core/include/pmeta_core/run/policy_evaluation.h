#pragma once

#include <memory>

#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/run/meta_trainer.h"

namespace pmeta {

/// Evaluates the policy of a file on the tasks of its experiment.
class PolicyEvaluation {
 public:
  /// `policy` must outlive it. Throws as the experiment's learners do.
  explicit PolicyEvaluation(const LoadedPolicy& policy);

  /// On at least `episodes` episodes that no round evaluates: a personal policy with what its file
  /// knows of its task, the meta-policy after exploration.
  ReturnStats on(int task, int episodes) const;

 private:
  const LoadedPolicy& policy_;
  std::unique_ptr<MetaTrainer> trainer_;  // of a meta-learner's policy
};

}  // namespace pmeta
