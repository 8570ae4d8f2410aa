#pragma once

#include <cstdint>
#include <vector>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// Adam (Kingma and Ba, 2015) in float64, with torch.optim.Adam's defaults; ProximalAdam is the
/// float32 one.
class Adam {
 public:
  /// Of `size` parameters.
  Adam(std::size_t size, double learning_rate)
      : learning_rate_(learning_rate), first_(size), second_(size) {}

  /// One step down the gradient [size].
  void step(double* parameters, const double* gradient);

  /// Moments and count of steps.
  void saveState(StateWriter& writer) const;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader);

 private:
  double learning_rate_;
  std::int64_t steps_ = 0;
  std::vector<double> first_, second_;  // moments
};

}  // namespace pmeta
