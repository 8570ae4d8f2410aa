#include "pmeta_core/baselines/trust_region.h"

#include <cmath>
#include <numeric>

namespace pmeta {
namespace {

double dot(const Vector& a, const Vector& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// y + scale x
Vector sum(const Vector& y, double scale, const Vector& x) {
  Vector result = y;
  for (std::size_t k = 0; k < x.size(); ++k) result[k] += scale * x[k];
  return result;
}

}  // namespace

Vector conjugateGradients(const std::function<Vector(const Vector&)>& product, const Vector& b,
                          int iterations) {
  Vector x(b.size());
  Vector residual = b;
  Vector direction = b;
  double squared = dot(residual, residual);
  for (int k = 0; k < iterations && squared >= 1e-10; ++k) {
    const Vector image = product(direction);
    const double step = squared / dot(direction, image);
    x = sum(x, step, direction);
    residual = sum(residual, -step, image);
    const double next = dot(residual, residual);
    direction = sum(residual, next / squared, direction);
    squared = next;
  }
  return x;
}

TrustRegionStep trustRegionStep(const Vector& theta, const Vector& gradient, double loss,
                                const std::function<Vector(const Vector&)>& kl_product,
                                const std::function<TriedStep(const Vector&)>& evaluate,
                                const TrustRegionSettings& settings) {
  const auto damped = [&](const Vector& v) { return sum(kl_product(v), settings.damping, v); };
  TrustRegionStep result;
  result.parameters = theta;
  result.direction = conjugateGradients(damped, gradient, settings.cg_iterations);
  result.curvature = dot(result.direction, damped(result.direction));
  double length = std::sqrt(2 * settings.max_kl / (result.curvature + 1e-8));
  if (!std::isfinite(length)) return result;
  for (int n = 0; n < settings.backtracks; ++n, length *= settings.backtrack_ratio) {
    const Vector candidate = sum(theta, -length, result.direction);
    result.tried.push_back(evaluate(candidate));
    if (result.tried.back().loss < loss && result.tried.back().kl <= settings.max_kl) {
      result.parameters = candidate;
      result.accepted = true;
      return result;
    }
  }
  return result;
}

}  // namespace pmeta
