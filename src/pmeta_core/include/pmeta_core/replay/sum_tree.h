#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// Weights with their running sums in a binary tree: a weight is set, and a prefix sum searched, in
/// O(log capacity) (Schaul et al., "Prioritized Experience Replay", ICLR 2016, appendix B.2.1).
///
/// Each sum is computed anew from its two children, so that rounding does not build up.
class SumTree {
 public:
  /// All weights 0. capacity: number of leaves, at least 1.
  explicit SumTree(std::size_t capacity);

  std::size_t capacity() const { return capacity_; }  ///< number of leaves
  double total() const { return sums_[1]; }           ///< sum of all weights
  /// Weight of a leaf below capacity().
  double get(std::size_t leaf) const { return sums_[leaves_ + leaf]; }

  /// weight: finite, at least 0.
  void set(std::size_t leaf, double weight);

  /// The weights of the first `count` leaves; loading refuses any that is not positive, or is
  /// beyond what a float can make of a TD error. All other leaves are 0.
  void saveState(StateWriter& writer, std::size_t count) const;
  /// Takes them back, with all sums computed anew.
  void loadState(StateReader& reader, std::size_t count);

  /// The leaf whose weight covers `prefix` in [0, total()): the sums before it are at most
  /// `prefix`, the sums up to and with it above. Never a leaf of weight 0 unless all are.
  std::size_t find(double prefix) const;

 private:
  std::size_t capacity_;
  std::size_t leaves_ = 1;    // capacity rounded up to a power of two
  std::vector<double> sums_;  // node k over nodes 2k and 2k + 1; the root is node 1
};

}  // namespace pmeta
