#pragma once

#include <cstdint>
#include <vector>

#include "pmeta_core/learn/dqn_settings.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/replay/prioritised_replay.h"

namespace pmeta {

/// The update of deep Q-learning on a batch that is given: target networks and the loss's gradient.
/// The parameters belong to the caller, who passes them in with an optimiser that moves them.
///
/// Target of a sample, with the mean Q_bar of the last K target networks
/// (K = 1: Mnih et al., Nature 2015; K > 1: averaged DQN, Anschel et al., ICML 2017):
///
///     y = R_n + discount * max_a Q_bar(s_n, a)
///     y = R_n + discount * Q_bar(s_n, argmax_a Q(s_n, a))    double_q (van Hasselt et al., 2016)
///
/// Loss: mean over the batch of w_b (Q(s_b, a_b) - y_b)^2, or w_b Huber(Q(s_b, a_b) - y_b), with
/// the importance weights w_b of the replay. Neither targets nor weights carry gradients.
class DqnUpdate {
 public:
  /// The network must outlive the update.
  DqnUpdate(const Mlp& network, const DqnSettings& settings);

  /// Makes every target network a copy of `parameters`; to be called before the first update.
  void resetTargets(const float* parameters);

  /// Hands the gradient of the loss on `batch` (settings.batch_size transitions) to `optimizer`
  /// and, at every target_update_interval-th call, copies the moved parameters to the (oldest)
  /// target network. Returns the loss. Allocates nothing.
  double apply(const float* parameters, const ReplayBatch& batch, Optimizer<float>& optimizer);

  const std::vector<float>& tdErrors() const { return td_errors_; }  ///< of the last batch
  const AlignedFloats& targets() const { return targets_; }  ///< of the K networks, one by one
  std::int64_t updates() const { return updates_; }          ///< calls of apply() so far

  void saveState(StateWriter& writer) const;  ///< target networks and the count of updates
  void loadState(StateReader& reader);        ///< refuses targets of another size or number

 private:
  void computeTargets(const float* parameters, const ReplayBatch& batch);
  double computeOutputGradient(const float* q_values, const ReplayBatch& batch);
  float* target(int k) { return targets_.data() + static_cast<std::size_t>(k) * network_.size(); }

  const Mlp& network_;
  DqnSettings settings_;
  int num_actions_;
  MlpWorkspace workspace_;
  AlignedFloats targets_;
  int newest_target_ = 0;
  std::int64_t updates_ = 0;
  std::vector<float> target_values_;    // batch x num_actions: Q_bar(s_n, .)
  std::vector<float> td_targets_;       // batch: y
  std::vector<float> td_errors_;        // batch: Q(s, a) - y
  std::vector<float> sample_gradient_;  // batch: of the loss by Q(s, a)
  std::vector<float> output_gradient_;  // batch x num_actions
  AlignedFloats gradient_;              // of all parameters
};

}  // namespace pmeta
