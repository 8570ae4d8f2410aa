#pragma once

#include <algorithm>
#include <cstdint>

namespace pmeta {

/// Exploration rate that moves linearly from `start` to `finish` over `updates`, then stays.
struct EpsilonSchedule {
  double start = 0;    ///< rate of the first update, from 0 to 1
  double finish = 0;   ///< rate after the slope, from 0 to 1
  double updates = 1;  ///< length of the slope; 0 means at `finish` from the beginning

  /// The rate after `done` updates.
  double at(std::int64_t done) const {
    if (updates <= 0) return finish;
    return start + (finish - start) * std::min(1.0, static_cast<double>(done) / updates);
  }
};

}  // namespace pmeta
