#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "pmeta_core/learn/dqn.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/personal/evaluation.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// pMeta-RL on a Q-network: deep Q-learning whose Adam steps are pulled towards the auxiliary
/// parameters (float32, one network).
///
/// A round resets parameters only. Adam's moments, the target networks, the replay and the states
/// of the environments are the learner's own and go on from round to round.
class DqnPersonalLearner : public PersonalLearner {
 public:
  /// `make_env` gives new environments of the task. `total_updates`: of the whole run (C * R).
  /// `make_training_env`, if given, gives the k-th one to train in, of whatever task. Throws Error
  /// where DqnLearner or ProximalAdam does.
  DqnPersonalLearner(const std::function<std::unique_ptr<Env>()>& make_env,
                     const DqnSettings& settings, const ProximalAdamSettings& optimizer,
                     std::int64_t total_updates,
                     const std::function<std::unique_ptr<Env>(int k)>& make_training_env = {});

  const ModelLayout& layout() const override { return layout_; }
  Model initialModel(std::uint64_t seed) const override;
  /// The first meta-policy is also the first target network.
  void beginRound(const Model& meta, bool keep_personal) override;
  UpdateStats update(Rng& rng) override;
  const Model& personal() const override { return personal_; }
  const Model& auxiliary() const override { return auxiliary_; }
  /// Mean over settings.evaluation_episodes greedy episodes. The starts depend on `rng` only: give
  /// it the same seed to compare policies.
  ReturnStats evaluate(const Model& policy, Rng& rng) const override;
  Episode record(const Model& policy, Rng& rng) const override;
  void saveState(StateWriter& writer) const override;
  void loadState(StateReader& reader) override;

  const DqnLearner& learner() const { return learner_; }
  const ProximalAdam& optimizer() const { return optimizer_; }

 private:
  BatchPolicy greedy(const Model& policy) const;

  DqnLearner learner_;
  ModelLayout layout_;
  Model personal_;
  Model auxiliary_;
  bool has_personal_ = false;
  ProximalAdam optimizer_;
  std::unique_ptr<Evaluation> evaluation_;
  std::unique_ptr<MlpWorkspace> evaluation_workspace_;
};

}  // namespace pmeta
