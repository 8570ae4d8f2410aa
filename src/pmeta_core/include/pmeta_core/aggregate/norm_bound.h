#pragma once

#include <string>
#include <vector>

namespace pmeta {

/// Which updates lie too far from the meta-policy to enter its average.
struct NormBound {
  double max_norm = 0;        ///< the furthest that is allowed; 0: any
  double outlier_factor = 0;  ///< the same, in medians of the round's norms; 0: any

  /// Can it object to anything?
  bool bounds() const { return max_norm > 0 || outlier_factor > 0; }

  /// For each norm of a round's updates what speaks against it, in a clause, or "". The median is
  /// that of all norms, and is asked only of three or more. The order does not matter.
  std::vector<std::string> objections(const std::vector<double>& norms) const;
};

}  // namespace pmeta
