#include "pmeta_core/aggregate/mix.h"

#include <algorithm>

#include "pmeta_core/base/error.h"

// one binary, the widest vectors of the machine it runs on; contraction is off, so all give equal
// bits
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)
#define PMETA_VECTORISED __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define PMETA_VECTORISED
#endif

namespace pmeta {
namespace {

// entries handled at a time: their sums stay in the first-level cache
constexpr std::size_t kChunk = 1024;

template <class Scalar>
inline void accumulateAll(double* sum, const Scalar* values, double weight, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) sum[k] += weight * static_cast<double>(values[k]);
}

PMETA_VECTORISED void accumulate(double* sum, const float* values, double weight, std::size_t n) {
  accumulateAll(sum, values, weight, n);
}

PMETA_VECTORISED void accumulate(double* sum, const double* values, double weight, std::size_t n) {
  accumulateAll(sum, values, weight, n);
}

template <class Scalar>
void mixValues(std::vector<Scalar>& meta, const std::vector<Contribution>& contributions,
               double beta) {
  std::vector<const std::vector<Scalar>*> values;
  bool any_mask = false;
  double total_weight = 0;
  for (const Contribution& one : contributions) {
    values.push_back(&std::get<std::vector<Scalar>>(one.model->values));
    any_mask = any_mask || !one.model->present.empty();
    total_weight += one.weight;
  }

  double sum[kChunk];
  double weight[kChunk];
  for (std::size_t begin = 0; begin < meta.size(); begin += kChunk) {
    const std::size_t n = std::min(kChunk, meta.size() - begin);
    std::fill_n(sum, n, 0.0);
    std::fill_n(weight, n, any_mask ? 0.0 : total_weight);
    for (std::size_t i = 0; i < contributions.size(); ++i) {
      const Scalar* x = values[i]->data() + begin;
      if (!any_mask) {
        accumulate(sum, x, contributions[i].weight, n);
        continue;
      }
      for (std::size_t k = 0; k < n; ++k) {
        if (!contributions[i].model->isPresent(begin + k)) continue;
        sum[k] += contributions[i].weight * static_cast<double>(x[k]);
        weight[k] += contributions[i].weight;
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

void mixInto(Model& meta, const std::vector<Contribution>& contributions, double beta) {
  for (const Contribution& one : contributions) {
    if (one.model->layout != meta.layout)
      throw Error("models of different layouts cannot be averaged.");
    if (!(one.weight > 0)) throw Error("the weight of a model in an average must be positive.");
  }
  if (contributions.empty()) return;
  std::visit(
      [&](auto& values) {
        using Scalar = typename std::decay_t<decltype(values)>::value_type;
        mixValues<Scalar>(values, contributions, beta);
      },
      meta.values);
}

}  // namespace pmeta
