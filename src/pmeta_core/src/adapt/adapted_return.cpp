#include "pmeta_core/adapt/adapted_return.h"

#include <algorithm>
#include <utility>

namespace pmeta {
namespace {

AdaptedReturn evaluateKnown(Evaluation& evaluation, const Adaptation& adaptation, int episodes,
                            Rng& rng) {
  const auto actor = adaptation.adapted(evaluation.width());
  return {episodes, evaluation.run(*actor, rng), adaptation.taskInput(), adaptation.taskWeights()};
}

}  // namespace

std::vector<AdaptedReturn> evaluateAdapted(Evaluation& evaluation, Adaptation& adaptation,
                                           const std::vector<int>& counts, Rng& rng) {
  const Rng starts = rng;
  // `rng` moves on, away from the starts
  std::vector<AdaptedReturn> returns = {evaluateKnown(evaluation, adaptation, 0, rng)};
  int broken = 0;  // since the last return
  for (int episode = 1; !counts.empty() && episode <= counts.back(); ++episode) {
    adaptation.beginEpisode(rng);
    broken += evaluation.explore(adaptation, rng) ? 0 : 1;
    adaptation.episodeOver();
    if (std::count(counts.begin(), counts.end(), episode) == 0) continue;
    Rng same_starts = starts;
    returns.push_back(evaluateKnown(evaluation, adaptation, episode, same_starts));
    returns.back().stats.broken_episodes += std::exchange(broken, 0);
  }
  return returns;
}

}  // namespace pmeta
