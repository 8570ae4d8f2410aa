#pragma once

#include <cstddef>

namespace pmeta {

// The losses of soft actor-critic by rows of a batch, [n] each.

/// What a state is worth by an action there: values = min_k q_k - alpha log pi.
void softValues(const float* q1, const float* q2, const float* log_prob, float alpha, std::size_t n,
                float* values);

/// What critics learn: y = scale * reward + discount * what the next state is worth.
void criticTargets(const float* rewards, const float* discounts, const float* next_values,
                   float scale, std::size_t n, float* y);

/// Mean of alpha log pi - min_k q_k.
double actorLoss(const float* q1, const float* q2, const float* log_prob, double alpha,
                 std::size_t n);

}  // namespace pmeta
