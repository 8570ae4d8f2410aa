#include "pmeta_core/nn/initialisation.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pmeta {
namespace {

// fewer vectors than each is long: normal ones, made orthonormal one after the other
std::vector<std::vector<double>> orthonormal(std::size_t count, std::size_t length, Rng& rng) {
  std::vector<std::vector<double>> vectors(count, std::vector<double>(length));
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double>& v = vectors[k];
    for (double& value : v) value = rng.normal();
    // twice, since the first pass leaves rounding errors of the size of what it took away
    for (std::size_t pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < k; ++i) {
        const double share = std::inner_product(v.begin(), v.end(), vectors[i].begin(), 0.0);
        for (std::size_t j = 0; j < length; ++j) v[j] -= share * vectors[i][j];
      }
    }
    const double norm = std::sqrt(std::inner_product(v.begin(), v.end(), v.begin(), 0.0));
    for (double& value : v) value /= norm;
  }
  return vectors;
}

void drawOrthogonal(std::size_t rows, std::size_t columns, float* weight, Rng& rng) {
  const auto vectors = orthonormal(std::min(rows, columns), std::max(rows, columns), rng);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      weight[r * columns + c] = static_cast<float>(rows <= columns ? vectors[r][c] : vectors[c][r]);
    }
  }
}

}  // namespace

void initialise(const std::vector<Block>& blocks, Initialisation how, float* parameters, Rng& rng) {
  for (const Block& block : blocks) {
    const std::size_t n = block.size();
    if (block.shape.size() != 2) {
      std::fill_n(parameters, n, 0.0f);
    } else if (how == Initialisation::kOrthogonal) {
      drawOrthogonal(block.shape[0], block.shape[1], parameters, rng);
    } else {
      const double bound = std::sqrt(6 / static_cast<double>(block.shape[0] + block.shape[1]));
      for (std::size_t k = 0; k < n; ++k) {
        parameters[k] = static_cast<float>(bound * (2 * rng.uniform() - 1));
      }
    }
    parameters += n;
  }
}

}  // namespace pmeta
