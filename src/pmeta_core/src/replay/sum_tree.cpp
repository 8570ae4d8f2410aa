#include "pmeta_core/replay/sum_tree.h"

namespace pmeta {

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
