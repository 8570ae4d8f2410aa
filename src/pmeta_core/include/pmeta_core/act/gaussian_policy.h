#pragma once

#include <cstddef>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/nn/aligned.h"

namespace pmeta {

/// Gaussian actions squashed into (-1, 1) by tanh (Haarnoja et al., "Soft Actor-Critic", 2018,
/// appendix C), reparameterised: u = mean + std * noise, a = tanh(u),
///
///     log pi(a) = sum_j [ log N(u_j; mean_j, std_j) - log(1 - a_j^2) ]
///
/// A network's output, the heads, is [batch, 2 * action_size]: means, then log std, which is
/// clamped to [-5, 2] and has no gradient outside. Holds what backward() needs of the last batch;
/// allocates nothing after construction.
class GaussianPolicy {
 public:
  static constexpr float kMinLogStd = -5;  ///< a standard deviation of 0.0067
  static constexpr float kMaxLogStd = 2;   ///< a standard deviation of 7.4

  /// For batches of up to `max_batch` rows.
  GaussianPolicy(std::size_t action_size, std::size_t max_batch);

  /// Draws an action for each row of `heads`.
  void sample(const float* heads, std::size_t batch, Rng& rng);

  /// The same with the standard normal `noise` given, [batch, action_size].
  void sampleWith(const float* heads, std::size_t batch, const float* noise);

  const float* actions() const { return action_.data(); }     ///< [batch, action_size]
  const float* logProbs() const { return log_prob_.data(); }  ///< [batch]: log pi(a)

  /// Gradient by the heads into `d_heads` [batch, 2 * action_size] of a loss whose gradient is
  /// `d_action` [batch, action_size] by the actions, and `d_log_prob` by every log pi(a). `batch`
  /// may be less than the last one: its first rows.
  void backward(std::size_t batch, const float* d_action, float d_log_prob, float* d_heads) const;

 private:
  std::size_t action_size_;
  // all [max_batch, action_size]
  AlignedFloats mean_, log_std_, noise_, action_, deviation_, log_density_;
  AlignedFloats log_prob_;
};

/// The policy without its noise: writes tanh(mean) for each row of heads, [batch, action_size].
void meanActions(const float* heads, std::size_t batch, std::size_t action_size, double* actions);

}  // namespace pmeta
