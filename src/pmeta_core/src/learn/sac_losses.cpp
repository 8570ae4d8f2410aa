#include "pmeta_core/learn/sac_losses.h"

namespace pmeta {

void softValues(const float* q1, const float* q2, const float* log_prob, float alpha, std::size_t n,
                float* values) {
  for (std::size_t b = 0; b < n; ++b) {
    values[b] = (q1[b] <= q2[b] ? q1[b] : q2[b]) - alpha * log_prob[b];
  }
}

void criticTargets(const float* rewards, const float* discounts, const float* next_values,
                   float scale, std::size_t n, float* y) {
  for (std::size_t b = 0; b < n; ++b) y[b] = scale * rewards[b] + discounts[b] * next_values[b];
}

double actorLoss(const float* q1, const float* q2, const float* log_prob, double alpha,
                 std::size_t n) {
  double loss = 0;
  for (std::size_t b = 0; b < n; ++b) {
    loss += alpha * log_prob[b] - (q1[b] <= q2[b] ? q1[b] : q2[b]);
  }
  return loss / static_cast<double>(n);
}

}  // namespace pmeta
