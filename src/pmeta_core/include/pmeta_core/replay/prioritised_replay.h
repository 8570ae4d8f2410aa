#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/replay/replay_buffer.h"
#include "pmeta_core/replay/sum_tree.h"

namespace pmeta {

/// Transitions drawn for one update, row-major with one row for each sample.
struct ReplayBatch {
  std::vector<std::size_t> slots;        ///< where each sample lies in the buffer
  std::vector<float> observations;       ///< batch x observation_size: s_t
  std::vector<float> actions;            ///< batch x action_size
  std::vector<float> rewards;            ///< n-step returns R_n
  std::vector<float> discounts;          ///< gamma^n, 0 where nothing is bootstrapped
  std::vector<float> next_observations;  ///< batch x observation_size: s_{t+n}
  std::vector<float> weights;            ///< importance weights, the largest of them 1
};

/// Replay that draws transition i with probability P(i) = p_i^alpha / sum_k p_k^alpha, where
/// p_i = |TD error| + 1e-6 (proportional prioritisation; Schaul et al., "Prioritized Experience
/// Replay", ICLR 2016). alpha = 0 is uniform replay: all weights are then 1.
class PrioritisedReplay {
 public:
  /// alpha, beta: in [0, 1]; beta stays as given.
  PrioritisedReplay(std::size_t capacity, int observation_size, int action_size, double alpha,
                    double beta);

  /// Stores a transition with the largest priority seen so far, so that it is drawn soon.
  void add(const Transition& transition);

  /// Draws `batch_size` transitions independently, with replacement, and their weights
  /// (N P(i))^-beta divided by the batch's maximum. The buffer must not be empty. Allocates only
  /// where `batch` was not of that size before.
  void sample(int batch_size, Rng& rng, ReplayBatch& batch) const;

  /// Sets p_i = |td_errors[b]| + 1e-6 for each sample b of `batch`.
  void setPriorities(const ReplayBatch& batch, const float* td_errors);

  void saveState(StateWriter& writer) const;  ///< transitions and their priorities
  /// Refuses transitions or priorities that no run leaves; see ReplayBuffer and SumTree.
  void loadState(StateReader& reader);

  std::size_t size() const { return buffer_.size(); }     ///< transitions held
  const ReplayBuffer& buffer() const { return buffer_; }  ///< what is held, by slot
  const SumTree& tree() const { return tree_; }           ///< p_i^alpha by slot
  /// The largest p_i set so far, at least 1; not yet to the power of alpha.
  double maxPriority() const { return max_priority_; }

 private:
  ReplayBuffer buffer_;
  SumTree tree_;
  double alpha_;
  double beta_;
  double max_priority_ = 1;
};

}  // namespace pmeta
