#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/evaluation.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// Strengths of the pull that some networks have of their own; -1: that of all. At 0 they are each
/// robot's own: a round does not reset them, and what is sent of them stays the meta-policy's.
struct SacLambdas {
  double actor = -1;
  double critic = -1;  ///< of both critics
  double encoder = -1;
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
                     int num_tasks, const SacLambdas& lambdas = {});

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
  std::vector<float> taskInput(const Model& policy) const override;
  /// With the action values at the start, if actions have two dimensions.
  Episode record(const Model& policy, Rng& rng) const override;
  Episode recordAdapted(const Model& policy, const AdaptedReturn& adapted, Rng& rng) const override;
  void saveState(StateWriter& writer) const override;
  void loadState(StateReader& reader) override;

  /// Returns of `policy` as at test time: it knows nothing of this learner's context but explores
  /// by itself, if it has an encoder. Evaluations start alike.
  std::vector<AdaptedReturn> evaluateAdapted(const Model& policy, Rng& rng) const override;

  const SacLearner& learner() const { return learner_; }
  const ProximalAdam& optimizer() const { return optimizer_; }

 private:
  BatchPolicy greedy(const Model& policy, const std::vector<float>& task_input) const;
  Episode recordWith(const Model& policy, const std::vector<float>& task_input, Rng& rng) const;
  void setLambda(std::size_t offset, const Mlp& network, double lambda);

  SacLearner learner_;
  ModelLayout layout_;
  Model personal_;
  Model auxiliary_;
  bool has_personal_ = false;
  std::vector<std::pair<std::size_t, std::size_t>> own_;  // [begin, end) that no round resets
  std::vector<float> explorer_;  // the meta-policy's actor of the round, where it explores
  ProximalAdam optimizer_;
  std::unique_ptr<Evaluation> evaluation_;
  std::unique_ptr<SacNetworks::ActorWorkspace> evaluation_workspace_;
  std::unique_ptr<Env> exploration_env_;
};

}  // namespace pmeta
