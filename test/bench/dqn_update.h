#pragma once

#include <algorithm>
#include <cstddef>

#include "bench_util.h"
#include "pmeta_core/nn/kernels.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace bench {

constexpr std::size_t kBatch = 64;
constexpr std::size_t kUnits = 512;

/// A DQN learner's update without its replay, 4 -> 512 -> 512 -> 2 at batch 64: two passes forward,
/// one back, one of Adam with pull and auxiliary. peers.py does the same in PyTorch.
class DqnUpdate {
 public:
  DqnUpdate()
      : mlp({"q", 4, {kUnits, kUnits}, 2}),
        online(mlp, kBatch),
        target(mlp, kBatch),
        phi(initial(mlp)),
        omega(phi),
        target_phi(phi),
        gradient(mlp.size()),
        observations(noise(kBatch * 4)),
        next_observations(noise(kBatch * 4, 0.9)),
        d_q(kBatch * 2),
        error(kBatch),
        d_error(kBatch),
        weight(kBatch, 0.5f),
        optimizer(phi.data(), omega.data(), mlp.size(), settings()) {}

  void operator()() {
    const float* next = mlp.forward(target_phi.data(), next_observations.data(), kBatch, target);
    const float* q = mlp.forward(phi.data(), observations.data(), kBatch, online);
    for (std::size_t b = 0; b < kBatch; ++b) {
      const float best = std::max(next[2 * b], next[2 * b + 1]);
      error[b] = q[2 * b + b % 2] - (1 + 0.99f * best);
    }
    pmeta::kernels().squaredLoss(error.data(), weight.data(), d_error.data(), kBatch);
    for (std::size_t b = 0; b < kBatch; ++b) {
      d_q[2 * b + b % 2] = d_error[b];
      d_q[2 * b + 1 - b % 2] = 0;
    }
    mlp.backward(phi.data(), observations.data(), kBatch, d_q.data(), gradient.data(), nullptr,
                 online);
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), mlp.size());
  }

  /// Four passes through the layers, but for the gradient by the observations.
  static double flops() {
    const double weights = 4.0 * kUnits + 1.0 * kUnits * kUnits + 2.0 * kUnits;
    return 2 * kBatch * (4 * weights - 4.0 * kUnits);
  }

  std::size_t parameters() const { return mlp.size(); }

 private:
  static pmeta::AlignedFloats initial(const pmeta::Mlp& mlp) {
    pmeta::AlignedFloats parameters(mlp.size());
    pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
    mlp.initialise(parameters.data(), rng);
    return parameters;
  }
  static pmeta::ProximalAdamSettings settings() {
    pmeta::ProximalAdamSettings settings;
    settings.lambda = 20;
    return settings;
  }

  pmeta::Mlp mlp;
  pmeta::MlpWorkspace online, target;
  pmeta::AlignedFloats phi, omega, target_phi, gradient;
  pmeta::AlignedFloats observations, next_observations, d_q, error, d_error, weight;
  pmeta::ProximalAdam optimizer;
};

}  // namespace bench
