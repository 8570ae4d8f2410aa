#include "pmeta_core/act/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pmeta {

Evaluation::Evaluation(std::vector<std::unique_ptr<Env>> envs, int episodes)
    : rollout_(std::move(envs), Rollout::AtEnd::kStop, std::numeric_limits<int>::max()),
      returns_(episodes > 0 ? static_cast<std::size_t>(episodes) : width()) {}

ReturnStats Evaluation::run(Actor& actor, Rng& rng) {
  ReturnStats stats;
  const std::int64_t broken_before = rollout_.broken().count();
  for (std::size_t first = 0; first < returns_.size(); first += width()) {
    const std::size_t count = std::min(width(), returns_.size() - first);
    for (rollout_.begin(count, actor, rng); rollout_.running();) rollout_.step(actor, rng);
    for (std::size_t i = 0; i < count; ++i) returns_[first + i] = rollout_.returned(i);
  }
  stats.episodes = static_cast<int>(returns_.size());
  stats.broken_episodes = static_cast<int>(rollout_.broken().count() - broken_before);
  for (const double value : returns_) stats.mean += value;
  stats.mean /= stats.episodes;
  double squares = 0;
  for (const double value : returns_) squares += (value - stats.mean) * (value - stats.mean);
  stats.std = std::sqrt(squares / stats.episodes);
  return stats;
}

Episode Evaluation::record(Actor& actor, Rng& rng) {
  const Env& env = rollout_.env(0);
  Episode episode;
  episode.observation_size = env.spec().observation_size;
  episode.action_size = env.spec().action_size;
  const auto keep = [&] {
    const double* observation = rollout_.observation(0);
    episode.observations.insert(episode.observations.end(), observation,
                                observation + episode.observation_size);
    const std::vector<double> configuration = env.configuration();
    episode.position_size = static_cast<int>(configuration.size());
    episode.positions.insert(episode.positions.end(), configuration.begin(), configuration.end());
  };

  rollout_.begin(1, actor, rng);
  if (!rollout_.running()) throw BrokenEpisode("the start of an episode of " + env.spec().name);
  keep();
  while (rollout_.running()) {
    if (rollout_.step(actor, rng) == 0) {
      episode.truncated = true;
      break;
    }
    keep();
    episode.actions.insert(episode.actions.end(), rollout_.action(0),
                           rollout_.action(0) + episode.action_size);
    const Step& step = rollout_.taken(0);
    episode.rewards.push_back(step.evaluatedReward());
    episode.terminated = step.terminated;
    episode.truncated = step.truncated;
  }
  return episode;
}

bool Evaluation::explore(Actor& actor, Rng& rng) {
  const std::int64_t broken_before = rollout_.broken().count();
  for (rollout_.begin(1, actor, rng); rollout_.running();) rollout_.step(actor, rng);
  return rollout_.broken().count() == broken_before;
}

}  // namespace pmeta
