#include "pmeta_core/run/policy_evaluation.h"

#include "pmeta_core/run/task_agent.h"

namespace pmeta {

PolicyEvaluation::PolicyEvaluation(const LoadedPolicy& policy) : policy_(policy) {
  if (!policy.experiment().hasMetaLearner()) return;
  trainer_ = std::make_unique<MetaTrainer>(policy.experiment());
}

ReturnStats PolicyEvaluation::on(int task, int episodes) const {
  if (trainer_) return trainer_->evaluateFresh(policy_.model(), task, episodes);
  const bool explores = policy_.experiment().contextEpisodes().size() > 1;
  return TaskAgent(policy_.experiment(), task)
      .evaluateFresh(explores ? PolicyKind::kMeta : policy_.policy(), policy_.model(), episodes);
}

}  // namespace pmeta
