#pragma once

#include <cstdint>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// Variance of all numbers so far (Welford, 1962).
class RunningVariance {
 public:
  /// Counts it in.
  void add(double value);

  double variance() const;  ///< population; 1 before the first number

  /// Count, mean and sum of squares.
  void saveState(StateWriter& writer) const;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader);

 private:
  std::int64_t count_ = 0;
  double mean_ = 0;
  double squares_ = 0;  // summed distances from the mean
};

}  // namespace pmeta
