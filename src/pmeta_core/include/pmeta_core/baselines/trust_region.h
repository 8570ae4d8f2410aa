#pragma once

#include <functional>
#include <utility>
#include <vector>

namespace pmeta {

/// Of as many numbers as there are parameters.
using Vector = std::vector<double>;

/// Approximately the x with A x = b, A positive definite and given by its product, by conjugate
/// gradients from 0: at most `iterations`, fewer where the squared residual falls below 1e-10.
Vector conjugateGradients(const std::function<Vector(const Vector&)>& product, const Vector& b,
                          int iterations);

/// Settings of a trust-region step (Schulman et al., "Trust Region Policy Optimization", 2015).
struct TrustRegionSettings {
  double max_kl = 0.01;          ///< delta
  double damping = 1e-5;         ///< added to the diagonal of the KL's Hessian
  int cg_iterations = 10;        ///< of conjugate gradients
  double backtrack_ratio = 0.8;  ///< from one step length that is tried to the next
  int backtracks = 15;           ///< step lengths that are tried
};

/// Loss and KL of a candidate.
struct TriedStep {
  double loss;  ///< to go down
  double kl;    ///< to stay within TrustRegionSettings::max_kl
};

/// What became of a trust-region step.
struct TrustRegionStep {
  Vector parameters;             ///< accepted, or those before
  bool accepted = false;         ///< else no candidate was good
  Vector direction;              ///< (F + damping)^-1 gradient
  double curvature = 0;          ///< direction . (F + damping) direction
  std::vector<TriedStep> tried;  ///< in order; the last is the accepted one
};

/// Of candidates theta - ratio^n sqrt(2 delta / curvature) direction, n = 0, 1, ..., the first with
/// less loss than `loss` and a KL of at most delta; theta where there is none.
///
/// `kl_product`: Hessian of the KL at theta times a vector. `evaluate`: loss and KL anywhere.
TrustRegionStep trustRegionStep(const Vector& theta, const Vector& gradient, double loss,
                                const std::function<Vector(const Vector&)>& kl_product,
                                const std::function<TriedStep(const Vector&)>& evaluate,
                                const TrustRegionSettings& settings);

}  // namespace pmeta
