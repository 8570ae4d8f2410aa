#include "pmeta_core/act/gaussian_policy.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/nn/kernels.h"

namespace pmeta {

GaussianPolicy::GaussianPolicy(std::size_t action_size, std::size_t max_batch, float min_log_std)
    : action_size_(action_size),
      min_log_std_(min_log_std),
      mean_(max_batch * action_size),
      log_std_(mean_),
      noise_(mean_),
      action_(mean_),
      deviation_(mean_),
      log_density_(mean_),
      log_prob_(max_batch) {}

void GaussianPolicy::sample(const float* heads, std::size_t batch, Rng& rng) {
  const std::size_t n = batch * action_size_;
  for (std::size_t k = 0; k < n; ++k) noise_[k] = static_cast<float>(rng.normal());
  sampleWith(heads, batch, noise_.data());
}

void GaussianPolicy::sampleWith(const float* heads, std::size_t batch, const float* noise) {
  // means and log std apart, so that the kernel runs through all rows at once
  for (std::size_t b = 0; b < batch; ++b) {
    const float* row = heads + 2 * b * action_size_;
    std::copy_n(row, action_size_, &mean_[b * action_size_]);
    std::copy_n(row + action_size_, action_size_, &log_std_[b * action_size_]);
  }
  kernels().tanhGaussian(mean_.data(), log_std_.data(), noise, min_log_std_, kMaxLogStd,
                         action_.data(), deviation_.data(), log_density_.data(),
                         batch * action_size_);
  for (std::size_t b = 0; b < batch; ++b) {
    float sum = 0;
    for (std::size_t j = 0; j < action_size_; ++j) sum += log_density_[b * action_size_ + j];
    log_prob_[b] = sum;
  }
}

void GaussianPolicy::backward(std::size_t batch, const float* d_action, float d_log_prob,
                              float* d_heads) const {
  for (std::size_t b = 0; b < batch; ++b) {
    float* d_mean = d_heads + 2 * b * action_size_;
    float* d_log_std = d_mean + action_size_;
    for (std::size_t j = 0; j < action_size_; ++j) {
      const std::size_t k = b * action_size_ + j;
      const float a = action_[k];
      // by u: da/du = 1 - a^2, and -log(1 - a^2) has the slope 2 a
      const float d_u = d_action[k] * (1 - a * a) + d_log_prob * (2 * a);
      d_mean[j] = d_u;
      d_log_std[j] = isInside(log_std_[k]) ? d_u * deviation_[k] - d_log_prob : 0;
    }
  }
}

double GaussianPolicy::addPenalty(std::size_t batch, double weight, float* d_heads) const {
  const double each = weight / static_cast<double>(batch * action_size_);
  const auto slope = static_cast<float>(2 * each);
  double squares = 0;
  for (std::size_t b = 0; b < batch; ++b) {
    float* d_mean = d_heads + 2 * b * action_size_;
    float* d_log_std = d_mean + action_size_;
    for (std::size_t j = 0; j < action_size_; ++j) {
      const std::size_t k = b * action_size_ + j;
      const float mean = mean_[k];
      const float log_std = std::min(std::max(log_std_[k], min_log_std_), kMaxLogStd);
      squares += static_cast<double>(mean) * mean + static_cast<double>(log_std) * log_std;
      d_mean[j] += slope * mean;
      if (isInside(log_std_[k])) d_log_std[j] += slope * log_std;
    }
  }
  return each * squares;
}

void meanActions(const float* heads, std::size_t batch, std::size_t action_size, double* actions) {
  for (std::size_t b = 0; b < batch; ++b, heads += 2 * action_size, actions += action_size) {
    for (std::size_t j = 0; j < action_size; ++j) {
      actions[j] = std::tanh(static_cast<double>(heads[j]));
    }
  }
}

}  // namespace pmeta
