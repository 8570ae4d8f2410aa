#include "pmeta_core/run/meta_keeper.h"

#include <cmath>

namespace pmeta {

void MetaKeeper::offer(const RoundBook::Round& round, const MetaPolicy& meta) {
  const double mean = round.summary.meta_return;
  if (round.rows.empty() || !std::isfinite(mean) || meta.round != round.summary.round) return;
  newest_.round = meta.round;
  newest_.mean_return = mean;
  best_.offer(experiment_, newest_, meta.model);
}

void MetaKeeper::saveLast(const MetaPolicy& meta) const {
  PolicyOrigin origin;
  origin.round = meta.round;
  if (newest_.round == meta.round) origin.mean_return = newest_.mean_return;
  saveRunPolicy(experiment_, Kept::kLast, origin, meta.model);
}

}  // namespace pmeta
