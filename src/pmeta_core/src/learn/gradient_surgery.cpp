#include "pmeta_core/learn/gradient_surgery.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace pmeta {
namespace {

// in double: sums of a hundred thousand products
double dot(const AlignedFloats& a, const AlignedFloats& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += static_cast<double>(a[k]) * b[k];
  return sum;
}

}  // namespace

void operate(const std::vector<AlignedFloats>& gradients, Rng& rng, AlignedFloats& scratch,
             float* sum) {
  std::vector<std::size_t> others(gradients.size());
  std::iota(others.begin(), others.end(), 0);
  std::fill_n(sum, scratch.size(), 0.0f);
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    for (std::size_t k = others.size(); k > 1; --k) std::swap(others[k - 1], others[rng.below(k)]);
    scratch = gradients[i];
    for (const std::size_t j : others) {
      if (j == i) continue;
      const double conflict = dot(scratch, gradients[j]);
      if (conflict >= 0) continue;
      const auto share = static_cast<float>(conflict / dot(gradients[j], gradients[j]));
      for (std::size_t k = 0; k < scratch.size(); ++k) scratch[k] -= share * gradients[j][k];
    }
    for (std::size_t k = 0; k < scratch.size(); ++k) sum[k] += scratch[k];
  }
}

}  // namespace pmeta
