#pragma once

#include <cstddef>

namespace pmeta {

/// Settings of the loss of proximal policy optimisation.
struct PpoSettings {
  double clip = 0.1;  ///< of the ratio of densities, beyond 1 on either side; positive
  double value_coefficient = 0.25;    ///< of the values' loss, at least 0
  bool huber = true;                  ///< of the values' error, with its edge at 1; else its square
  bool clip_values = true;            ///< they gain nothing by moves of more than `clip`
  double entropy_coefficient = 0.01;  ///< at least 0
};

/// Smallest log std of a policy whose log std is a free parameter: below it acts as at it.
constexpr double kLowestLogStd = -13.815510557964274;  // of std 1e-6

/// log of the normal density of `action` with independent components.
double logDensity(const float* action, const float* mean, const float* log_std,
                  std::size_t action_size);

/// Steps as they were acted, and what was made of them.
struct PpoBatch {
  std::size_t steps;               ///< of all its episodes
  std::size_t action_size;         ///< numbers of an action
  const float* actions;            ///< [steps, action_size], not clipped
  const float* old_log_densities;  ///< [steps], by the policy that acted
  const float* old_values;         ///< [steps], by the critic of then
  const float* advantages;         ///< [steps]
  const float* returns;            ///< [steps], that the values are to foretell
};

/// Where gradients by the outputs of policy and critic go.
struct PpoGradients {
  float* d_means;    ///< [steps, action_size]
  float* d_values;   ///< [steps]
  float* d_log_std;  ///< [action_size], summed over steps
};

/// What they are gradients of, apart, and how far the policy has moved.
struct PpoLoss {
  double policy = 0;   ///< -mean of what is clipped
  double value = 0;    ///< without its coefficient
  double entropy = 0;  ///< of the policy, in nats
  double kl = 0;       ///< mean of log old density - log density
  double clipped = 0;  ///< share of steps whose ratio has left the interval

  /// What is minimised.
  double total(const PpoSettings& settings) const {
    return policy + settings.value_coefficient * value - settings.entropy_coefficient * entropy;
  }
};

/// Loss of proximal policy optimisation (Schulman et al., 2017) for normal actions u with mean
/// `means` [steps, action_size] and std exp(log_std), r = pi(u) / pi_old(u):
///
///     mean over steps of -min(r A, clip(r, 1 - eps, 1 + eps) A) + c_V l(V - R)  -  c_H H
///
/// l(e) is h(e) (Huber) or e^2. With clip_values l is the larger one of that and of the same with V
/// cut to within eps of the old value.
PpoLoss ppo(const PpoSettings& settings, const PpoBatch& batch, const float* means,
            const float* log_std, const float* values, const PpoGradients& gradients);

}  // namespace pmeta
