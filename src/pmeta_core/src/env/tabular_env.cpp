#include "pmeta_core/env/tabular_env.h"

namespace pmeta {

const Outcome& TabularEnv::sample(int state, int action, Rng& rng) const {
  const std::vector<Outcome>& all = outcomes(state, action);
  if (all.size() == 1) return all.front();
  double left = rng.uniform();
  for (const Outcome& outcome : all) {
    left -= outcome.probability;
    if (left < 0) return outcome;
  }
  return all.back();
}

}  // namespace pmeta
