#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/evaluation.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// Returns of one policy before and after it has explored the task.
struct AdaptedReturns {
  ReturnStats before;               ///< z at the prior's mean
  ReturnStats after;                ///< z at the posterior's mean
  std::vector<double> exploration;  ///< return of each episode of exploration
  std::int64_t env_steps = 0;       ///< transitions that exploring took
};

/// pMeta-RL on the networks of soft actor-critic (float32): actor, both critics and the context
/// encoder, if there is one, are pulled towards their auxiliary parameters (paper, Definition 2).
///
/// A round resets parameters only. Adam's moments, target critics, replay, context, temperature and
/// the environment's state are the learner's own and go on, unless targets_at_round and
/// reset_moments say otherwise.
class SacPersonalLearner : public PersonalLearner {
 public:
  /// `make_env` gives new environments of task `task` out of `num_tasks`. Throws Error where
  /// SacLearner or ProximalAdam does.
  SacPersonalLearner(const std::function<std::unique_ptr<Env>()>& make_env,
                     const SacSettings& settings, const ProximalAdamSettings& optimizer, int task,
                     int num_tasks);

  const ModelLayout& layout() const override { return layout_; }
  Model initialModel(std::uint64_t seed) const override;
  /// The first meta-policy's critics are also the first targets.
  void beginRound(const Model& meta, bool keep_personal) override;
  UpdateStats update(Rng& rng) override;
  /// With one_hot and own_column, the columns of the other tasks' entries are absent.
  const Model& personal() const override { return personal_; }
  const Model& auxiliary() const override { return auxiliary_; }
  /// Mean over settings.evaluation_episodes episodes by tanh(mean), whose starts depend on `rng`
  /// only. The task input is this task's one-hot vector, or the mean of z that the policy's own
  /// encoder infers from the context this learner has collected.
  ReturnStats evaluate(const Model& policy, Rng& rng) const override;
  Episode record(const Model& policy, Rng& rng) const override;

  /// Returns of `policy` as at test time: nothing of this learner's context, but exploration in an
  /// environment of evaluation. Both start alike. Throws Error without an encoder.
  AdaptedReturns evaluateAdapted(const Model& policy, Rng& rng) const;

  const SacLearner& learner() const { return learner_; }
  const ProximalAdam& optimizer() const { return optimizer_; }

 private:
  std::vector<float> taskInput(const Model& policy) const;
  BatchPolicy greedy(const Model& policy, const std::vector<float>& task_input) const;

  SacLearner learner_;
  ModelLayout layout_;
  Model personal_;
  Model auxiliary_;
  bool has_personal_ = false;
  ProximalAdam optimizer_;
  std::unique_ptr<Evaluation> evaluation_;
  std::unique_ptr<SacNetworks::ActorWorkspace> evaluation_workspace_;
  std::unique_ptr<Env> exploration_env_;
};

}  // namespace pmeta
