#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pmeta {

/// Numbers of one fused optimiser pass. Unused ones are ignored.
struct AdamPass {
  float step_size = 0;        ///< learning rate / (1 - beta1^t)
  float beta1 = 0.9f;         ///< decay of the first moment
  float beta2 = 0.999f;       ///< decay of the second moment
  float one_minus_beta1 = 0;  ///< rounded from double, as torch does
  float one_minus_beta2 = 0;  ///< rounded from double, as torch does
  float root_correction = 1;  ///< 1 / sqrt(1 - beta2^t)
  float eps = 1e-8f;          ///< added outside the square root
  float pull = 0;             ///< decoupled: alpha * lambda; coupled: lambda
  float follow = 0;           ///< eta * lambda
  bool coupled = false;       ///< the pull is added to the gradient before Adam
  float tau = 0;              ///< Polyak step of the target
};

/// The loops that are not matrix products, compiled for one instruction set.
///
/// Matrices are row-major and dense. Pointers need no alignment; those of one call must not
/// overlap. No table contracts into fused multiply-adds and all sum in one order, so that every
/// table gives the same bits.
struct Kernels {
  const char* name;  ///< "x86-64-v4", "x86-64-v3" or "default"

  /// y[r][c] <- y[r][c] + bias[c].
  void (*addBias)(float* y, const float* bias, std::size_t rows, std::size_t columns);

  /// y[r][c] <- max(0, y[r][c] + bias[c]). NaN stays NaN, so that divergence shows.
  void (*addBiasRelu)(float* y, const float* bias, std::size_t rows, std::size_t columns);

  /// y <- x W^T + bias for few rows or few outputs: x is [rows, inputs], W [outputs, inputs] and y
  /// [rows, outputs]; max(0, .) of it where `relu`. Reads W once for every row.
  void (*affine)(const float* x, const float* weight, const float* bias, float* y, std::size_t rows,
                 std::size_t inputs, std::size_t outputs, bool relu);

  /// d[k] <- activation[k] <= 0 ? 0 : d[k], where `activation` is the ReLU's output.
  void (*maskRelu)(float* d, const float* activation, std::size_t n);

  /// y[k] <- tanh(y[k]), to a few units of rounding of 1. NaN stays NaN.
  void (*hyperbolicTangent)(float* y, std::size_t n);

  /// d[k] <- d[k] (1 - activation[k]^2), where `activation` is the tanh's output.
  void (*scaleByTanhSlope)(float* d, const float* activation, std::size_t n);

  /// sums[c] <- sum over r of x[r][c]: a bias gradient.
  void (*columnSums)(const float* x, float* sums, std::size_t rows, std::size_t columns);

  /// Squared loss, mean_k w_k e_k^2: writes its gradient 2 w_k e_k / n and returns the loss.
  /// `weight` may be null: all one.
  float (*squaredLoss)(const float* error, const float* weight, float* gradient, std::size_t n);

  /// Huber loss, mean_k w_k h(e_k) with h(e) = e^2 / 2 where |e| <= delta, else
  /// delta (|e| - delta / 2): writes its gradient w_k clamp(e_k, -delta, delta) / n and returns the
  /// loss. `weight` may be null: all one.
  float (*huberLoss)(const float* error, const float* weight, float delta, float* gradient,
                     std::size_t n);

  /// n components of a Gaussian squashed by tanh, u = mean + std * noise and action = tanh(u) with
  /// std = exp(log_std), log_std first clamped to [low, high]. Also writes deviation = std * noise
  /// and log_density, the component's share of log pi(action) (Haarnoja et al., 2018, appendix C):
  ///
  ///     -noise^2 / 2 - log_std - log(2 pi) / 2 - 2 (log 2 - |u| - log(1 + exp(-2 |u|)))
  ///
  /// Errors are a few units of rounding of the largest summand; NaN stays NaN.
  void (*tanhGaussian)(const float* mean, const float* log_std, const float* noise, float low,
                       float high, float* action, float* deviation, float* log_density,
                       std::size_t n);

  /// One step of a gated recurrent unit (Cho et al., 2014; reset after the product): a row of
  /// `gates` holds what the input gives to n, r, z and `units` numbers more, one of `recurrent`
  /// what the hidden state h gives to r, z and n (q), biases added:
  ///
  ///     r <- sigmoid(r + r_h),  z <- sigmoid(z + z_h),  n <- tanh(n + r q)
  ///     next <- (1 - z) n + z h
  ///
  /// The row of `gates` is n, r, z, q then. h is `previous`.
  void (*gruForward)(float* gates, const float* recurrent, const float* previous, float* next,
                     std::size_t rows, std::size_t units);

  /// Back through it: rows of `gates` become the loss's gradients by what was summed up for n, r
  /// and z, and by q; `d_previous` becomes z d_next, the part that does not pass through the gates.
  void (*gruBackward)(float* gates, const float* previous, const float* d_next, float* d_previous,
                      std::size_t rows, std::size_t units);

  /// One pass over n parameters:
  ///
  ///     g      <- gradient + (coupled) lambda (phi - omega)
  ///     m      <- beta1 m + (1 - beta1) g,  v <- beta2 v + (1 - beta2) g^2
  ///     phi'   <- phi - step_size m / (sqrt(v) root_correction + eps)
  ///     phi'   <- phi' - (decoupled) alpha lambda (phi' - omega)     with the old omega
  ///     omega  <- omega + eta lambda (phi' - omega)                  with the new phi
  ///     target <- target + tau (phi' - target)
  ///
  /// `omega` and `target` may be null: their lines are left out. Moments below 1e-30 and 1e-36
  /// become 0, since denormals cost a hundred cycles each and move nothing.
  void (*adam)(const AdamPass& pass, float* phi, float* m, float* v, const float* gradient,
               float* omega, float* target, std::size_t n);
};

/// The fastest table of this machine, or the one setKernels() chose.
const Kernels& kernels();

/// Tables this machine can run, fastest first. The last one is always "default".
std::vector<std::string> kernelNames();

/// Makes kernels() return the table `name`, for tests and benchmarks. Throws Error on a name that
/// is not in kernelNames().
void setKernels(const std::string& name);

}  // namespace pmeta
