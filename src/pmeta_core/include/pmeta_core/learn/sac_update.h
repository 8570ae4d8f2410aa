#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmeta_core/act/gaussian_policy.h"
#include "pmeta_core/learn/context_store.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/temperature.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// What one update of SacUpdate gave.
struct SacLosses {
  double critic = 0;       ///< mean of both critics' losses
  double actor = 0;        ///< mean of alpha log pi - min_k Q_k
  double entropy = 0;      ///< minus the mean of log pi over the batch
  double temperature = 0;  ///< alpha after the update
  double kl = 0;           ///< KL(q(z|c) || N(0, I)); 0 without an encoder
};

/// The update of soft actor-critic (Haarnoja et al., "Soft Actor-Critic Algorithms and
/// Applications", 2018), with PEARL's inference network if wanted (Rakelly et al., 2019), on a
/// batch that is given: target critics, temperature and gradients.
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
class SacUpdate {
 public:
  /// `task_input`: x of every row, where no encoder infers it. The networks must outlive the
  /// update. Throws Error if there are more contexts than rows.
  SacUpdate(const SacNetworks& networks, const SacSettings& settings,
            std::vector<float> task_input);

  /// Makes the target critics copies of `parameters`'; to be called before the first update.
  void resetTargets(const float* parameters);

  /// The contexts of the next update, to be drawn before any row is put in; none without an
  /// encoder.
  std::vector<InferredTask>& tasks() { return tasks_; }

  std::size_t batch() const { return batch_; }  ///< transitions of an update

  /// Takes the transition as the row-th of the batch.
  void put(std::size_t row, const Transition& transition);

  /// Hands `optimizer` the gradients of critic 1 and 2 (whose targets follow in the same pass), of
  /// the encoder, and, with the moved critics, of the actor; last, the temperature moves. Allocates
  /// nothing.
  SacLosses apply(const float* parameters, Optimizer<float>& optimizer, Rng& rng);

  const Temperature& temperature() const { return temperature_; }  ///< as the last update left it
  const AlignedFloats& targets() const { return targets_; }        ///< critic 1's, then critic 2's
  std::int64_t updates() const { return updates_; }                ///< calls of apply() so far

  /// Targets, temperature and count.
  void saveState(StateWriter& writer) const;
  /// Refuses targets of another size, and a temperature that is not finite.
  void loadState(StateReader& reader);

 private:
  void computeTargets();
  double updateCritic(int k, const float* parameters, Optimizer<float>& optimizer);
  double updateEncoder(const float* parameters, Optimizer<float>& optimizer);
  double updateActor(const float* parameters, Optimizer<float>& optimizer);
  void actionGradient(int k, const float* parameters);
  InferredTask& taskOf(std::size_t row) { return tasks_[row * tasks_.size() / batch_]; }
  float* target(int k) { return targets_.data() + (k == 0 ? 0 : networks_.critic(0).size()); }

  const SacNetworks& networks_;
  double reward_scale_, tau_, kl_weight_;
  std::size_t batch_, observation_size_, action_size_;
  std::vector<float> task_input_;
  Temperature temperature_;
  AlignedFloats targets_;
  std::int64_t updates_ = 0;

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

  std::vector<InferredTask> tasks_;  // empty without an encoder
  AlignedFloats d_latent_rows_;      // batch x latent
  AlignedFloats encoder_gradient_;   // of one context
};

}  // namespace pmeta
