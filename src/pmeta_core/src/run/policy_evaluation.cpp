#include "pmeta_core/run/policy_evaluation.h"

#include "pmeta_core/run/task_agent.h"

namespace pmeta {

PolicyEvaluation::PolicyEvaluation(const LoadedPolicy& policy) : policy_(policy) {
  if (!policy.experiment().hasMetaLearner()) return;
  trainer_ = std::make_unique<MetaTrainer>(policy.experiment());
}

ReturnStats PolicyEvaluation::on(int task, int episodes) const {
  if (trainer_) return trainer_->evaluateFresh(policy_.model(), task, episodes);
  const Experiment& experiment = policy_.experiment();
  if (policy_.policy() == PolicyKind::kMeta) {
    return TaskAgent(experiment, task).evaluateFresh(PolicyKind::kMeta, policy_.model(), episodes);
  }
  const std::unique_ptr<PersonalLearner> learner = experiment.makeLearner(task);
  return overFreshEpisodes(
      static_cast<std::uint64_t>(experiment.settings().seed), task, episodes,
      [&](Rng& rng) { return learner->evaluate(policy_.model(), policy_.taskInput(), rng); });
}

}  // namespace pmeta
