#include "pmeta_core/baselines/ppo.h"

#include <algorithm>
#include <cmath>

namespace pmeta {
namespace {

constexpr double kLogRootTwoPi = 0.91893853320467274;

double boundedLogStd(float log_std) {
  return std::max(static_cast<double>(log_std), kLowestLogStd);
}

struct Penalty {
  double value, slope;
};

Penalty penaltyOf(double error, bool huber) {
  if (!huber) return {error * error, 2 * error};
  if (std::abs(error) <= 1) return {error * error / 2, error};
  return {std::abs(error) - 0.5, error < 0 ? -1.0 : 1.0};
}

Penalty valuePenalty(const PpoSettings& settings, double value, double old, double goal) {
  const Penalty plain = penaltyOf(value - goal, settings.huber);
  if (!settings.clip_values || std::abs(value - old) <= settings.clip) return plain;
  const double cut = old + std::clamp(value - old, -settings.clip, settings.clip);
  const double clipped = penaltyOf(cut - goal, settings.huber).value;
  return clipped > plain.value ? Penalty{clipped, 0} : plain;
}

// gradients of log pi(u), each times `factor`
void addLogDensityGradient(const float* action, const float* mean, const float* log_std,
                           std::size_t n, double factor, float* d_mean, float* d_log_std) {
  for (std::size_t j = 0; j < n; ++j) {
    const double std = std::exp(boundedLogStd(log_std[j]));
    const double e = (action[j] - mean[j]) / std;
    d_mean[j] = static_cast<float>(factor * e / std);
    if (log_std[j] >= kLowestLogStd) d_log_std[j] += static_cast<float>(factor * (e * e - 1));
  }
}

}  // namespace

double logDensity(const float* action, const float* mean, const float* log_std,
                  std::size_t action_size) {
  double sum = 0;
  for (std::size_t j = 0; j < action_size; ++j) {
    const double l = boundedLogStd(log_std[j]);
    const double e = (action[j] - mean[j]) / std::exp(l);
    sum -= 0.5 * e * e + l + kLogRootTwoPi;
  }
  return sum;
}

PpoLoss ppo(const PpoSettings& settings, const PpoBatch& batch, const float* means,
            const float* log_std, const float* values, const PpoGradients& gradients) {
  const std::size_t n = batch.action_size;
  const double share = 1 / static_cast<double>(batch.steps);
  PpoLoss loss;
  for (std::size_t j = 0; j < n; ++j) {
    loss.entropy += boundedLogStd(log_std[j]) + 0.5 + kLogRootTwoPi;
    const bool moves = log_std[j] >= kLowestLogStd;
    gradients.d_log_std[j] = moves ? static_cast<float>(-settings.entropy_coefficient) : 0.0f;
  }
  for (std::size_t t = 0; t < batch.steps; ++t) {
    const float *action = batch.actions + t * n, *mean = means + t * n;
    const double change = logDensity(action, mean, log_std, n) - batch.old_log_densities[t];
    const double ratio = std::exp(change);
    const double advantage = batch.advantages[t];
    const double clipped = std::clamp(ratio, 1 - settings.clip, 1 + settings.clip) * advantage;
    const bool flat = clipped < ratio * advantage;  // the minimum is the clipped one
    loss.policy -= share * std::min(ratio * advantage, clipped);
    loss.kl -= share * change;
    loss.clipped += std::abs(ratio - 1) > settings.clip ? share : 0;
    addLogDensityGradient(action, mean, log_std, n, flat ? 0 : -share * ratio * advantage,
                          gradients.d_means + t * n, gradients.d_log_std);

    const Penalty penalty =
        valuePenalty(settings, values[t], batch.old_values[t], batch.returns[t]);
    loss.value += share * penalty.value;
    gradients.d_values[t] = static_cast<float>(settings.value_coefficient * share * penalty.slope);
  }
  return loss;
}

}  // namespace pmeta
