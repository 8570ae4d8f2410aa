#include "pmeta_core/run/party.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "pmeta_core/base/error.h"

namespace pmeta {

void Party::savePersonal(const Experiment&, int) const {}
void Party::keepBest(const Experiment&) {}

ReturnStats overFreshEpisodes(std::uint64_t seed, int task, int episodes,
                              const std::function<ReturnStats(Rng& rng)>& evaluate) {
  ReturnStats total;
  double mean_of_squares = 0;
  for (std::uint64_t batch = 1; total.episodes < episodes; ++batch) {
    // rounds evaluate with round 0 of this stream
    Rng rng(seed, static_cast<std::uint64_t>(task), Stream::kEvaluate, batch);
    const ReturnStats stats = evaluate(rng);
    const double share = static_cast<double>(stats.episodes) / (total.episodes + stats.episodes);
    total.mean += share * (stats.mean - total.mean);
    mean_of_squares += share * (stats.mean * stats.mean + stats.std * stats.std - mean_of_squares);
    total.episodes += stats.episodes;
    total.broken_episodes += stats.broken_episodes;
  }
  total.std = std::sqrt(std::max(0.0, mean_of_squares - total.mean * total.mean));
  return total;
}

void refuseUnevaluated(const MetaPolicy& meta) {
  throw Error("the meta-policy of round " + std::to_string(meta.round) +
              " has not been evaluated: do that before recording an episode of it.");
}

void RoundResult::saveState(StateWriter& writer) const {
  writer.count("env_steps", env_steps);
  writer.count("updates", updates);
  writer.count("broken_episodes", broken_episodes);
  writer.value("loss", loss);
  writer.value("distance", distance);
  writer.flag("evaluated", personal.has_value());
  if (personal) writer.part("personal", *personal);
}

void RoundResult::loadState(StateReader& reader) {
  env_steps = reader.count("env_steps");
  updates = reader.count("updates");
  broken_episodes = reader.count("broken_episodes");
  loss = reader.value<double>("loss");
  distance = reader.value<double>("distance");
  personal.reset();
  if (reader.flag("evaluated")) reader.part("personal", personal.emplace());
}

}  // namespace pmeta
