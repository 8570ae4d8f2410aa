#include "pmeta_core/replay/sum_tree.h"

#include <algorithm>

namespace pmeta {
namespace {

// above any float; as many as there is memory for have a finite sum
constexpr double kMostWeight = 1e39;

}  // namespace

SumTree::SumTree(std::size_t capacity) : capacity_(capacity) {
  while (leaves_ < capacity) leaves_ *= 2;
  sums_.assign(2 * leaves_, 0.0);
}

void SumTree::set(std::size_t leaf, double weight) {
  std::size_t node = leaves_ + leaf;
  sums_[node] = weight;
  while (node > 1) {
    node /= 2;
    sums_[node] = sums_[2 * node] + sums_[2 * node + 1];
  }
}

void SumTree::saveState(StateWriter& writer, std::size_t count) const {
  writer.array("weights", sums_.data() + leaves_, count);
}

void SumTree::loadState(StateReader& reader, std::size_t count) {
  double* weights = sums_.data() + leaves_;
  std::fill(sums_.begin(), sums_.end(), 0.0);
  reader.array("weights", weights, count);
  // false for what is not a number, too
  const bool good = std::all_of(weights, weights + count,
                                [](double weight) { return weight > 0 && weight <= kMostWeight; });
  if (!good) reader.refuse("weights", "holds one that is no weight");
  for (std::size_t node = leaves_ - 1; node > 0; --node) {
    sums_[node] = sums_[2 * node] + sums_[2 * node + 1];
  }
}

std::size_t SumTree::find(double prefix) const {
  std::size_t node = 1;
  while (node < leaves_) {
    node *= 2;
    // rounding may leave a prefix at the very end of a sum: do not follow it into nothing
    if (prefix >= sums_[node] && sums_[node + 1] > 0) {
      prefix -= sums_[node];
      ++node;
    }
  }
  return node - leaves_;
}

}  // namespace pmeta
