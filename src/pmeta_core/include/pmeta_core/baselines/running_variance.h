#pragma once

#include <cstdint>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// Variance of all numbers so far (Welford, 1962).
class RunningVariance {
 public:
  void add(double value);

  double variance() const;  ///< population; 1 before the first number

  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);

 private:
  std::int64_t count_ = 0;
  double mean_ = 0;
  double squares_ = 0;  // summed distances from the mean
};

}  // namespace pmeta
