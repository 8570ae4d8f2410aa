#include "bench_util.h"

#include <cmath>
#include <vector>

#include "pmeta_core/base/rng.h"

namespace bench {
namespace {

WIDEST_VECTORS void addToArrays(float* const* arrays, int count, const float* g, std::size_t n) {
  // pieces that stay in the first cache: g comes from afar once, as in a fused pass
  constexpr std::size_t kPiece = 512;
  for (std::size_t begin = 0; begin < n; begin += kPiece) {
    const std::size_t end = std::min(begin + kPiece, n);
    for (int a = 0; a < count; ++a) {
      float* __restrict x = arrays[a];
      const float* __restrict y = g;
      for (std::size_t k = begin; k < end; ++k) x[k] += y[k];
    }
  }
}

WIDEST_VECTORS void divideByRoots(const float* __restrict m, const float* __restrict v,
                                  float* __restrict step, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) step[k] = m[k] / std::sqrt(v[k]);
}

}  // namespace

pmeta::AlignedFloats noise(std::size_t n, double size) {
  pmeta::Rng rng(1, n, pmeta::Stream::kMeasure);
  pmeta::AlignedFloats values(n);
  for (float& value : values) value = static_cast<float>(size * (2 * rng.uniform() - 1));
  return values;
}

WIDEST_VECTORS float readAll(const float* x, std::size_t n) {
  constexpr std::size_t kLanes = 128;
  float sums[kLanes] = {};
  for (std::size_t k = 0; k + kLanes <= n; k += kLanes) {
    for (std::size_t j = 0; j < kLanes; ++j) sums[j] += x[k + j];
  }
  float sum = 0;
  for (const float lane : sums) sum += lane;
  return sum;
}

double readSeconds(std::size_t n) {
  const pmeta::AlignedFloats values(n);
  const int batch = std::max<int>(1, static_cast<int>(1000000 / n));
  return callSeconds(40, batch, [&] {
    benchmark::DoNotOptimize(readAll(values.data(), n));
    benchmark::ClobberMemory();
  });
}

double adamFloorSeconds(std::size_t n, int written) {
  std::vector<pmeta::AlignedFloats> arrays(static_cast<std::size_t>(written),
                                           pmeta::AlignedFloats(n));
  std::vector<float*> pointers;
  for (pmeta::AlignedFloats& array : arrays) pointers.push_back(array.data());
  const pmeta::AlignedFloats g(n);
  const double traffic = callSeconds(40, 1, [&] {
    addToArrays(pointers.data(), written, g.data(), n);
    benchmark::ClobberMemory();
  });

  // little enough for the first cache, often enough to make n
  constexpr std::size_t kPiece = 2048;
  const pmeta::AlignedFloats m(kPiece, 0.5f), v(kPiece, 2.0f);
  pmeta::AlignedFloats step(kPiece);
  const double piece = callSeconds(40, 50, [&] {
    divideByRoots(m.data(), v.data(), step.data(), kPiece);
    benchmark::ClobberMemory();
  });
  return std::max(traffic, piece * static_cast<double>(n) / kPiece);
}

}  // namespace bench
