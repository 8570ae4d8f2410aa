#pragma once

#include <vector>

#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/base/model.h"

namespace pmeta {

/// meta <- (1 - beta) * meta + beta * trimmed mean of the contributions, entry by entry.
///
/// Of the n values that an entry has (one of each contribution that has it present), sorted,
/// floor(trim * n) are cut at each end, but one or two always stay; the rest is averaged in double
/// precision. trim is from 0 (the mean) to 0.5 (the median). An entry that no contribution has
/// keeps its value. The result does not depend on the contributions' order. Weights must be equal.
/// Extra memory does not grow with the number of parameters. Throws Error.
/// Source: Yin et al., Byzantine-Robust Distributed Learning, ICML 2018.
void mixTrimmedInto(Model& meta, const std::vector<Contribution>& contributions, double beta,
                    double trim);

}  // namespace pmeta
