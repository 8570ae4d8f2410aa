#include "pmeta_core/aggregate/mix.h"

#include <algorithm>

#include "pmeta_core/base/error.h"
#include "vectorised.h"

namespace pmeta {
namespace {

// entries handled at a time: their sums stay in the second-level cache, and each contribution is
// read in runs long enough for the memory to stream
constexpr std::size_t kChunk = 8192;

// contributions added in one pass over the sums, in their order: the same bits as one by one
constexpr std::size_t kTogether = 4;

template <class Scalar>
inline __attribute__((always_inline)) void addOne(double* __restrict sum,
                                                  const Scalar* __restrict x, double weight,
                                                  std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) sum[k] += weight * static_cast<double>(x[k]);
}

template <class Scalar>
inline __attribute__((always_inline)) void addTogether(double* __restrict sum,
                                                       const Scalar* const* x, const double* weight,
                                                       std::size_t n) {
  const Scalar* __restrict x0 = x[0];
  const Scalar* __restrict x1 = x[1];
  const Scalar* __restrict x2 = x[2];
  const Scalar* __restrict x3 = x[3];
  const double w0 = weight[0], w1 = weight[1], w2 = weight[2], w3 = weight[3];
  for (std::size_t k = 0; k < n; ++k) {
    double total = sum[k];
    total += w0 * static_cast<double>(x0[k]);
    total += w1 * static_cast<double>(x1[k]);
    total += w2 * static_cast<double>(x2[k]);
    total += w3 * static_cast<double>(x3[k]);
    sum[k] = total;
  }
}

template <class Scalar>
inline __attribute__((always_inline)) void addAll(double* sum, const Scalar* const* x,
                                                  const double* weight, std::size_t count,
                                                  std::size_t n) {
  std::size_t i = 0;
  for (; i + kTogether <= count; i += kTogether) addTogether(sum, x + i, weight + i, n);
  for (; i < count; ++i) addOne(sum, x[i], weight[i], n);
}

// sum[k] += weight[i] * x[i][k], i ascending
PMETA_VECTORISED void accumulate(double* sum, const float* const* x, const double* weight,
                                 std::size_t count, std::size_t n) {
  addAll(sum, x, weight, count, n);
}

PMETA_VECTORISED void accumulate(double* sum, const double* const* x, const double* weight,
                                 std::size_t count, std::size_t n) {
  addAll(sum, x, weight, count, n);
}

template <class Scalar>
void mixValues(std::vector<Scalar>& meta, const std::vector<Contribution>& contributions,
               double beta) {
  std::vector<const Scalar*> chunk(contributions.size());  // where each one's chunk begins
  std::vector<double> weights;
  bool any_mask = false;
  double total_weight = 0;
  for (const Contribution& one : contributions) {
    any_mask = any_mask || !one.model->present.empty();
    weights.push_back(one.weight);
    total_weight += one.weight;
  }

  double sum[kChunk];
  double weight[kChunk];
  for (std::size_t begin = 0; begin < meta.size(); begin += kChunk) {
    const std::size_t n = std::min(kChunk, meta.size() - begin);
    std::fill_n(sum, n, 0.0);
    std::fill_n(weight, n, any_mask ? 0.0 : total_weight);
    for (std::size_t i = 0; i < contributions.size(); ++i) {
      chunk[i] = std::get<std::vector<Scalar>>(contributions[i].model->values).data() + begin;
    }
    if (!any_mask) accumulate(sum, chunk.data(), weights.data(), chunk.size(), n);
    for (std::size_t i = 0; any_mask && i < contributions.size(); ++i) {
      for (std::size_t k = 0; k < n; ++k) {
        if (!contributions[i].model->isPresent(begin + k)) continue;
        sum[k] += weights[i] * static_cast<double>(chunk[i][k]);
        weight[k] += weights[i];
      }
    }
    for (std::size_t k = 0; k < n; ++k) {
      if (weight[k] == 0) continue;
      const double mean = sum[k] / weight[k];
      meta[begin + k] =
          static_cast<Scalar>((1 - beta) * static_cast<double>(meta[begin + k]) + beta * mean);
    }
  }
}

}  // namespace

void requireMixable(const Model& meta, const std::vector<Contribution>& contributions) {
  for (const Contribution& one : contributions) {
    if (one.model->layout != meta.layout)
      throw Error("models of different layouts cannot be averaged.");
    if (!(one.weight > 0)) throw Error("the weight of a model in an average must be positive.");
  }
}

void mixInto(Model& meta, const std::vector<Contribution>& contributions, double beta) {
  requireMixable(meta, contributions);
  if (contributions.empty()) return;
  std::visit(
      [&](auto& values) {
        using Scalar = typename std::decay_t<decltype(values)>::value_type;
        mixValues<Scalar>(values, contributions, beta);
      },
      meta.values);
}

}  // namespace pmeta
