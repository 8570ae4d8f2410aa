#pragma once

#include <vector>

#include "pmeta_core/base/model.h"

namespace pmeta {

/// One party's part in an average.
struct Contribution {
  const Model* model = nullptr;  ///< same layout as the meta model
  double weight = 1;             ///< positive
};

/// Throws Error unless all contributions have the meta model's layout and positive weights.
void requireMixable(const Model& meta, const std::vector<Contribution>& contributions);

/// meta <- (1 - beta) * meta + beta * weighted mean of the contributions: eqs. (global_update0) and
/// (global_update).
///
/// Each entry averages over the contributions that have it present (the paper's N_s); an entry that
/// none has keeps its value. Sums run in the order given, in double precision, so that the result
/// depends on that order and nothing else. Reads each value once; extra memory does not grow with
/// the number of parameters.
void mixInto(Model& meta, const std::vector<Contribution>& contributions, double beta);

}  // namespace pmeta
