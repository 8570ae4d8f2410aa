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

  /// On at least `episodes` episodes that no round evaluates. What a personal policy knew of its
  /// task went with its agent: where policies explore, it explores anew, as a meta-policy does.
  ReturnStats on(int task, int episodes) const;

 private:
  const LoadedPolicy& policy_;
  std::unique_ptr<MetaTrainer> trainer_;  // of a meta-learner's policy
};

}  // namespace pmeta
