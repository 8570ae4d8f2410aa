#pragma once

#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/nn/aligned.h"

namespace pmeta {

/// Gradient surgery (Yu et al., "Gradient Surgery for Multi-Task Learning", 2020, algorithm 1): of
/// each task's gradient goes, for every other task in an order that is drawn, what conflicts with
/// the other's gradient g_j,
///
///     g_i <- g_i - (g_i . g_j / |g_j|^2) g_j   where g_i . g_j < 0,
///
/// g_j as it was before surgery. Writes the sum of what is left into `sum`. `gradients`: of each
/// task, all of one length. `scratch` has that length.
void operate(const std::vector<AlignedFloats>& gradients, Rng& rng, AlignedFloats& scratch,
             float* sum);

}  // namespace pmeta
