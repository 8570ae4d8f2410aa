#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/baselines/ppo.h"
#include "pmeta_core/baselines/rl2_networks.h"
#include "pmeta_core/baselines/trials.h"

namespace pmeta {

/// What is made of a trial before it is learnt from; all by step.
struct TrialTargets {
  AlignedFloats log_densities;  ///< of its actions, by the policy that acted
  AlignedFloats values;         ///< by the critic of then
  AlignedFloats advantages;     ///< normalised over the batch
  AlignedFloats returns;        ///< what the critic is to foretell
};

/// The networks of RL² over whole trials: forward, and back through time.
class Rl2Update {
 public:
  /// For minibatches of up to `max_trials` trials of up to `max_steps` steps each. The networks
  /// must outlive it.
  Rl2Update(const Rl2Networks& networks, const PpoSettings& settings, std::size_t max_trials,
            std::size_t max_steps);

  /// Fills in log densities and values of the trials `chosen`.
  void evaluate(const float* parameters, const std::vector<Trial>& trials,
                const std::vector<std::size_t>& chosen, std::vector<TrialTargets>& targets);

  /// Loss of the trials `chosen`, which have at least one step in all, and its gradient.
  PpoLoss gradient(const float* parameters, const std::vector<Trial>& trials,
                   const std::vector<TrialTargets>& targets, const std::vector<std::size_t>& chosen,
                   float* gradient);

 private:
  void unroll(const float* parameters, const std::vector<Trial>& trials,
              const std::vector<std::size_t>& chosen);
  template <class Row>
  void forEachStep(Row&& row) const;

  const Rl2Networks& networks_;
  PpoSettings settings_;
  GruWorkspace recurrent_;
  MlpWorkspace mean_, value_;
  // of the trials at hand: the longest first, and how many of them go on at each step
  std::vector<std::size_t> order_, batches_;
  std::size_t rows_ = 0;
  const float *hidden_ = nullptr, *means_ = nullptr, *values_ = nullptr;
  // by row: steps of one time together
  AlignedFloats inputs_, actions_, log_densities_, old_values_, advantages_, returns_;
  AlignedFloats d_means_, d_values_, d_hidden_, d_hidden_of_value_;
};

}  // namespace pmeta
