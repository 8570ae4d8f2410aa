#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/rng.h"

namespace pmeta {

/// How matrices of weights are drawn.
enum class Initialisation {
  kOrthogonal,  ///< orthonormal rows, or columns where there are fewer of those (Saxe et al., 2014)
  kGlorot,      ///< uniform in +-sqrt(6 / (inputs + outputs)) (Glorot and Bengio, 2010)
};

/// Draws every matrix among `blocks`, whose values lie one after the other in `parameters`, and
/// sets all else to 0.
void initialise(const std::vector<Block>& blocks, Initialisation how, float* parameters, Rng& rng);

}  // namespace pmeta
