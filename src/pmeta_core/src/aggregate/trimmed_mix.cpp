#include "pmeta_core/aggregate/trimmed_mix.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "pmeta_core/base/error.h"
#include "vectorised.h"

namespace pmeta {
namespace {

// entries sorted side by side: their values, a row for each contribution, stay in the first-level
// cache for some tens of contributions, and in the second for a thousand
constexpr std::size_t kColumns = 64;

using Comparator = std::pair<std::size_t, std::size_t>;

// Batcher's merge exchange (Knuth, The Art of Computer Programming, vol. 3, 5.2.2, algorithm M):
// the comparisons that sort n values whatever they are, so that many columns go through them at
// once
std::vector<Comparator> sortingNetwork(std::size_t n) {
  std::vector<Comparator> network;
  if (n < 2) return network;
  std::size_t top = 1;
  while (2 * top < n) top *= 2;
  for (std::size_t p = top; p > 0; p /= 2) {
    std::size_t q = top, r = 0, d = p;
    while (true) {
      for (std::size_t i = 0; i + d < n; ++i) {
        if ((i & p) == r) network.emplace_back(i, i + d);
      }
      if (q == p) break;
      d = q - p;
      q /= 2;
      r = p;
    }
  }
  return network;
}

// without the comparisons that no value of rank first..last depends on
std::vector<Comparator> prune(const std::vector<Comparator>& network, std::size_t n,
                              std::size_t first, std::size_t last) {
  std::vector<char> needed(n, 0);
  std::fill(needed.begin() + static_cast<std::ptrdiff_t>(first),
            needed.begin() + static_cast<std::ptrdiff_t>(last), 1);
  std::vector<Comparator> kept;
  for (auto it = network.rbegin(); it != network.rend(); ++it) {
    if (!needed[it->first] && !needed[it->second]) continue;
    needed[it->first] = needed[it->second] = 1;
    kept.push_back(*it);
  }
  std::reverse(kept.begin(), kept.end());
  return kept;
}

template <class Scalar>
inline __attribute__((always_inline)) void sortColumnsOf(Scalar* rows, const Comparator* network,
                                                         std::size_t size) {
  for (std::size_t c = 0; c < size; ++c) {
    Scalar* __restrict low = rows + network[c].first * kColumns;
    Scalar* __restrict high = rows + network[c].second * kColumns;
    for (std::size_t k = 0; k < kColumns; ++k) {
      const Scalar a = low[k], b = high[k];
      low[k] = b < a ? b : a;
      high[k] = b < a ? a : b;
    }
  }
}

PMETA_VECTORISED void sortColumns(float* rows, const Comparator* network, std::size_t size) {
  sortColumnsOf(rows, network, size);
}

PMETA_VECTORISED void sortColumns(double* rows, const Comparator* network, std::size_t size) {
  sortColumnsOf(rows, network, size);
}

template <class Scalar>
inline __attribute__((always_inline)) void sumRowsOf(double* __restrict sum,
                                                     const Scalar* __restrict rows,
                                                     std::size_t count) {
  std::fill_n(sum, kColumns, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < kColumns; ++k) {
      sum[k] += static_cast<double>(rows[i * kColumns + k]);
    }
  }
}

PMETA_VECTORISED void sumRows(double* sum, const float* rows, std::size_t count) {
  sumRowsOf(sum, rows, count);
}

PMETA_VECTORISED void sumRows(double* sum, const double* rows, std::size_t count) {
  sumRowsOf(sum, rows, count);
}

// how many of n values are cut at each end
std::size_t cut(double trim, std::size_t n) {
  // 0.29 * 100 is 28.999...
  const auto count = static_cast<std::size_t>(trim * static_cast<double>(n) + 1e-9);
  return std::min(count, (n - 1) / 2);
}

template <class Scalar>
class TrimmedMix {
 public:
  TrimmedMix(const std::vector<Contribution>& contributions, double trim)
      : contributions_(contributions), trim_(trim), rows_(contributions.size() * kColumns) {
    for (const Contribution& one : contributions) masked_ = masked_ || !one.model->present.empty();
    const std::size_t n = contributions.size();
    network_ = sortingNetwork(n);
    // with masks each entry has its own number of values, and its own ranks that count
    if (!masked_) network_ = prune(network_, n, cut(trim, n), n - cut(trim, n));
  }

  void mixInto(std::vector<Scalar>& meta, double beta) {
    double mean[kColumns];
    for (std::size_t begin = 0; begin < meta.size(); begin += kColumns) {
      const std::size_t width = std::min(kColumns, meta.size() - begin);
      load(begin, width);
      sortColumns(rows_.data(), network_.data(), network_.size());
      average(mean);
      for (std::size_t k = 0; k < width; ++k) {
        if (owners_[k] == 0) continue;
        Scalar& value = meta[begin + k];
        value = static_cast<Scalar>((1 - beta) * static_cast<double>(value) + beta * mean[k]);
      }
    }
  }

 private:
  // a row for each contribution; what it does not own sorts behind everything
  void load(std::size_t begin, std::size_t width) {
    std::fill_n(owners_, kColumns, contributions_.size());
    for (std::size_t i = 0; i < contributions_.size(); ++i) {
      const Model& model = *contributions_[i].model;
      Scalar* row = rows_.data() + i * kColumns;
      std::copy_n(std::get<std::vector<Scalar>>(model.values).data() + begin, width, row);
      std::fill(row + width, row + kColumns, Scalar{0});
      for (std::size_t k = 0; masked_ && k < width; ++k) {
        if (model.isPresent(begin + k)) continue;
        row[k] = std::numeric_limits<Scalar>::infinity();
        --owners_[k];
      }
    }
  }

  void average(double* mean) const {
    if (!masked_) {
      const std::size_t n = contributions_.size(), ends = cut(trim_, n);
      sumRows(mean, rows_.data() + ends * kColumns, n - 2 * ends);
      for (std::size_t k = 0; k < kColumns; ++k) mean[k] /= static_cast<double>(n - 2 * ends);
      return;
    }
    for (std::size_t k = 0; k < kColumns; ++k) {
      const std::size_t n = owners_[k];
      if (n == 0) continue;
      const std::size_t ends = cut(trim_, n);
      double sum = 0;
      for (std::size_t i = ends; i < n - ends; ++i) {
        sum += static_cast<double>(rows_[i * kColumns + k]);
      }
      mean[k] = sum / static_cast<double>(n - 2 * ends);
    }
  }

  const std::vector<Contribution>& contributions_;
  const double trim_;
  std::vector<Scalar> rows_;
  std::size_t owners_[kColumns] = {};  ///< how many contributions have each column's entry
  bool masked_ = false;
  std::vector<Comparator> network_;
};

}  // namespace

void mixTrimmedInto(Model& meta, const std::vector<Contribution>& contributions, double beta,
                    double trim) {
  if (!(trim >= 0 && trim <= 0.5)) {
    throw Error("the share that is cut at each end must be from 0 to 0.5.");
  }
  requireMixable(meta, contributions);
  for (const Contribution& one : contributions) {
    if (one.weight != contributions.front().weight) {
      throw Error("a median or trimmed mean takes models of equal weights only.");
    }
  }
  if (contributions.empty()) return;
  std::visit(
      [&](auto& values) {
        using Scalar = typename std::decay_t<decltype(values)>::value_type;
        TrimmedMix<Scalar>(contributions, trim).mixInto(values, beta);
      },
      meta.values);
}

}  // namespace pmeta
