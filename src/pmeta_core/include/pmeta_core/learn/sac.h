#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/broken_episodes.h"
#include "pmeta_core/learn/gaussian_policy.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/temperature.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// What one update of SacLearner gave.
struct SacLosses {
  double critic = 0;       ///< mean of both critics' losses
  double actor = 0;        ///< mean of alpha log pi - min_k Q_k
  double entropy = 0;      ///< minus the mean of log pi over the batch
  double temperature = 0;  ///< alpha after the update
  double kl = 0;           ///< KL(q(z|c) || N(0, I)); 0 without an encoder
};

/// Soft actor-critic on one task with continuous actions in [-1, 1] (Haarnoja et al., "Soft
/// Actor-Critic Algorithms and Applications", 2018), with PEARL's inference network if wanted
/// (Rakelly et al., 2019): environment, replay, context, target critics and temperature.
///
/// The parameters belong to the caller, laid out as SacNetworks says; it passes them in, and an
/// optimiser that moves them. With x the task input, a' ~ pi(s', x) and a ~ pi(s, x):
///
///     y         = scale * r + discount * (min_k Qbar_k(s', x, a') - alpha log pi(a'))
///     critic k:   mean over the batch of (Q_k(s, x, a_stored) - y)^2
///     encoder:    the sum of both critics' losses by z + kl_weight * KL(q(z|c) || N(0, I))
///     actor:      mean over the batch of alpha log pi(a) - min_k Q_k(s, x, a), z fixed
///
/// discount is gamma, 0 after a terminal state; the horizon is none. Each context of an update
/// gives its z to an equal part of the batch.
class SacLearner {
 public:
  /// `task_input`: the one-hot vector with task_encoding "one_hot", else empty. Throws Error where
  /// SacNetworks does, or if the task input does not fit the encoding.
  SacLearner(std::unique_ptr<Env> env, const SacSettings& settings,
             std::vector<float> task_input = {});

  const SacNetworks& networks() const { return networks_; }

  /// Makes the target critics copies of `parameters`'; to be called before the first update.
  void resetTargets(const float* parameters);

  /// env_steps_per_update steps by samples of the policy, kept in the replay; the first call also
  /// starts the environment and warms it up. With an encoder, z is drawn anew for each episode:
  /// from the prior in every prior_interval-th, else from q(z|c). On z from the prior `explorer`
  /// acts, if not null: another actor's parameters. Those transitions become context, and with
  /// posterior_episodes all do.
  /// An episode that breaks down is counted, and another begun; of its last step nothing is kept.
  /// Returns the transitions made. Allocates nothing once the buffers are full.
  std::int64_t collect(const float* parameters, Rng& rng, const float* explorer = nullptr);

  /// One batch from the replay. Hands `optimizer` the gradients of critic 1 and 2 (whose targets
  /// follow in the same pass), of the encoder, and, with the moved critics, of the actor; last, the
  /// temperature moves. Throws Error before the first collect(). Allocates nothing.
  SacLosses update(const float* parameters, Optimizer<float>& optimizer, Rng& rng);

  /// q(z|c) by the whole context that is kept.
  LatentPosterior contextPosterior(const float* parameters) const;

  const SacSettings& settings() const { return settings_; }
  const std::vector<float>& taskInput() const { return task_input_; }  ///< z while acting
  const Temperature& temperature() const { return temperature_; }
  const AlignedFloats& targets() const { return targets_; }  ///< critic 1's, then critic 2's
  const ReplayBuffer& replay() const { return replay_; }
  const ReplayBuffer& context() const { return context_; }  ///< rewards: Step::evaluatedReward()
  std::int64_t updates() const { return updates_; }         ///< calls of update() so far
  const Env& env() const { return *env_; }
  std::int64_t brokenEpisodes() const { return broken_.count(); }

  /// All but parameters and optimiser: replay, context, targets, temperature, the environment in
  /// mid-episode, counters.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);

 private:
  void beginEpisode(const float* parameters, bool warm_up, Rng& rng);
  std::int64_t step(const float* parameters, const float* explorer, bool warm_up, Rng& rng);
  void sampleContext(float* rows, Rng& rng);
  void sampleBatch(Rng& rng);
  void drawTask(std::size_t context, const float* parameters, Rng& rng);
  void computeTargets();
  double updateCritic(int k, const float* parameters, Optimizer<float>& optimizer);
  double updateEncoder(const float* parameters, Optimizer<float>& optimizer);
  double updateActor(const float* parameters, Optimizer<float>& optimizer);
  void actionGradient(int k, const float* parameters);
  std::size_t contextOf(std::size_t row) const { return row * update_inputs_.size() / batch_; }
  float* target(int k) { return targets_.data() + (k == 0 ? 0 : networks_.critic(0).size()); }

  std::unique_ptr<Env> env_;
  SacSettings settings_;
  SacNetworks networks_;
  std::size_t batch_, observation_size_, action_size_;
  std::vector<float> task_input_;
  Temperature temperature_;
  ReplayBuffer replay_, context_;
  AlignedFloats targets_;
  std::int64_t updates_ = 0;
  std::int64_t episodes_ = 0;  // after the warm-up
  BrokenEpisodes broken_;
  bool started_ = false;
  bool prior_episode_ = true;  // this episode's transitions become context

  // of the environment
  std::vector<float> observation_, next_observation_float_, action_float_;
  std::vector<double> next_observation_, action_;
  SacNetworks::ActorWorkspace acting_;
  GaussianPolicy acting_policy_;

  // of one update
  MlpWorkspace actor_workspace_;                 // rows: s, then s'
  std::vector<MlpWorkspace> critic_workspaces_;  // of critic 1 and 2
  GaussianPolicy policy_;                        // rows: s, then s'
  AlignedFloats actor_input_;                    // 2 batch x (observation, x)
  AlignedFloats critic_input_;                   // batch x (observation, x, action)
  AlignedFloats next_critic_input_;
  std::vector<float> rewards_, discounts_, y_, errors_, d_q_;
  std::vector<std::size_t> minimum_rows_[2];  // where critic 1 or 2 is the smaller one
  AlignedFloats d_action_rows_, d_action_, d_heads_;
  AlignedFloats gradient_;  // of one network at a time

  // one context of an update and the z drawn from its posterior
  struct DrawnTask {
    AlignedFloats rows;
    ContextEncoder::Workspace workspace;
    LatentPosterior posterior;
    std::vector<double> noise;
    std::vector<float> d_latent;
  };
  std::vector<DrawnTask> drawn_;                   // empty without an encoder
  std::vector<std::vector<float>> update_inputs_;  // x of each; the task input without an encoder
  AlignedFloats d_latent_rows_;                    // batch x latent
  AlignedFloats encoder_gradient_;                 // of one context
};

}  // namespace pmeta
