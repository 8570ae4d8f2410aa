#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/learn/context_store.h"
#include "pmeta_core/learn/learner.h"
#include "pmeta_core/learn/sac_collector.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/sac_update.h"
#include "pmeta_core/learn/task_model_update.h"
#include "pmeta_core/learn/task_source.h"

namespace pmeta {

/// Soft actor-critic on one task with continuous actions in [-1, 1]: SacUpdate on uniform batches
/// of what a SacCollector has kept, with a ContextStore where there is an encoder, and a
/// TaskModelUpdate where there is a task model. The latter draws from a stream of its own: actor
/// and critics are the same with and without it, as long as no episode explores.
///
/// discount of a transition is gamma, 0 after a terminal state; the horizon is none.
class SacLearner : public Learner {
 public:
  /// `task_input`: with task_encoding "one_hot" or "model" the one-hot vector, else empty. Throws
  /// Error where SacNetworks does, or if the task input does not fit the encoding.
  SacLearner(std::unique_ptr<Env> env, const SacSettings& settings,
             std::vector<float> task_input = {});

  /// Makes the target critics copies of `parameters`'; to be called before the first update.
  void resetTargets(const float* parameters) { update_.resetTargets(parameters); }

  /// See SacCollector.
  std::int64_t collect(const float* parameters, Rng& rng, const float* explorer = nullptr) {
    return collector_.collect(parameters, rng, explorer);
  }

  /// One batch from the replay, see SacUpdate. Throws Error before the first collect(). Allocates
  /// nothing.
  SacLosses update(const float* parameters, Optimizer<float>& optimizer, Rng& rng);

  const PolicyFamily& policies() const override { return policies_; }
  /// With own_column, where it is told the task, the columns of the other tasks' entries are
  /// absent.
  Model blank() const override;
  /// The first meta-policy's critics are also the first targets.
  void beginRound(const Model& meta, bool first) override;
  UpdateStats learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) override;
  const std::vector<Loss>& losses() const override { return losses_; }
  /// The one-hot vector, or the mean of z that the policy's own encoder infers from the context.
  std::vector<float> taskInput(const Model& policy) const override;
  std::optional<ReturnStats> exactReturn(const Model&) const override { return std::nullopt; }
  /// The action values at the start, if actions have two dimensions.
  void addValues(const Model& policy, const std::vector<float>& task_input,
                 Episode& episode) const override;

  /// What the parameters are of.
  const SacNetworks& networks() const { return policies_.networks(); }
  const SacSettings& settings() const { return settings_; }  ///< as given to the constructor
  const std::vector<float>& taskInput() const { return collector_.taskInput(); }  ///< while acting
  /// The weight of the entropy, as the last update left it.
  const Temperature& temperature() const { return update_.temperature(); }
  /// Parameters of target critic 1, then of 2.
  const AlignedFloats& targets() const { return update_.targets(); }
  /// Transitions, warm-up included.
  const ReplayBuffer& replay() const { return collector_.replay(); }
  const ContextStore& context() const { return *context_; }  ///< only with an encoder
  /// What the task model learns from, with the reward that policies are judged by; only with one.
  const ReplayBuffer& modelled() const { return *modelled_; }
  std::int64_t updates() const { return update_.updates(); }  ///< calls of update() so far
  /// Training episodes so far whose simulation broke down.
  std::int64_t brokenEpisodes() const { return collector_.brokenEpisodes(); }

  void saveState(StateWriter& writer) const override;
  /// Refuses an empty replay or context after the start, and another task's input.
  void loadState(StateReader& reader) override;

 private:
  std::unique_ptr<TaskSource> makeSource(const std::vector<float>& task_input);
  double updateModel(const float* parameters, Optimizer<float>& optimizer, const Rng& rng);
  void report(const SacLosses& losses, double model_loss);

  SacSettings settings_;
  std::vector<float> own_input_;  // as it is told in training; empty where it is not
  SacPolicies policies_;
  std::optional<ContextStore> context_;
  std::optional<ReplayBuffer> modelled_;
  std::unique_ptr<TaskSource> source_;
  SacCollector collector_;
  SacUpdate update_;
  std::optional<TaskModelUpdate> model_update_;
  std::vector<float> explorer_;  // the meta-policy's actor of the round, where it explores
  std::vector<Loss> losses_;
};

}  // namespace pmeta
