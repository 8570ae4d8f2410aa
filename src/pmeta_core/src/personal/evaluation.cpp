#include "pmeta_core/personal/evaluation.h"

#include <algorithm>
#include <cmath>

namespace pmeta {

Evaluation::Evaluation(std::vector<std::unique_ptr<Env>> envs)
    : envs_(std::move(envs)),
      observation_size_(static_cast<std::size_t>(envs_.front()->spec().observation_size)),
      action_size_(static_cast<std::size_t>(envs_.front()->spec().action_size)),
      running_(envs_.size()),
      returns_(envs_.size()),
      observation_(observation_size_),
      observations_(envs_.size() * observation_size_),
      actions_(envs_.size() * action_size_) {}

// false: it broke down
bool Evaluation::reset(std::size_t i, Rng& rng) {
  try {
    envs_[i]->reset(rng, observation_.data());
    return true;
  } catch (const BrokenEpisode&) {
    return false;
  }
}

// nothing: it broke down
std::optional<Step> Evaluation::step(std::size_t i, const double* action, Rng& rng) {
  try {
    return envs_[i]->step(action, rng, observation_.data());
  } catch (const BrokenEpisode&) {
    return std::nullopt;
  }
}

ReturnStats Evaluation::run(const BatchPolicy& policy, Rng& rng) {
  ReturnStats stats;
  running_.clear();
  for (std::size_t i = 0; i < envs_.size(); ++i) {
    returns_[i] = 0;
    if (!reset(i, rng)) {
      ++stats.broken_episodes;
      continue;
    }
    std::copy(observation_.begin(), observation_.end(),
              &observations_[running_.size() * observation_size_]);
    running_.push_back(i);
  }
  while (!running_.empty()) {
    policy(observations_.data(), static_cast<int>(running_.size()), actions_.data());
    std::size_t kept = 0;
    for (std::size_t k = 0; k < running_.size(); ++k) {
      const std::size_t i = running_[k];
      const std::optional<Step> step = this->step(i, &actions_[k * action_size_], rng);
      if (!step) ++stats.broken_episodes;
      if (step) returns_[i] += step->evaluatedReward();
      if (!step || step->terminated || step->truncated) continue;
      // close up: kept <= k, so nothing unread is overwritten
      running_[kept] = i;
      std::copy(observation_.begin(), observation_.end(), &observations_[kept * observation_size_]);
      ++kept;
    }
    running_.resize(kept);
  }

  stats.episodes = static_cast<int>(returns_.size());
  for (const double value : returns_) stats.mean += value;
  stats.mean /= stats.episodes;
  double squares = 0;
  for (const double value : returns_) squares += (value - stats.mean) * (value - stats.mean);
  stats.std = std::sqrt(squares / stats.episodes);
  return stats;
}

Episode Evaluation::record(const BatchPolicy& policy, Rng& rng) {
  Episode episode;
  episode.observation_size = static_cast<int>(observation_size_);
  episode.action_size = static_cast<int>(action_size_);
  Env& env = *envs_.front();
  const auto keep = [&] {
    episode.observations.insert(episode.observations.end(), observation_.begin(),
                                observation_.end());
    std::copy(observation_.begin(), observation_.end(), observations_.begin());
    const std::vector<double> configuration = env.configuration();
    episode.position_size = static_cast<int>(configuration.size());
    episode.positions.insert(episode.positions.end(), configuration.begin(), configuration.end());
  };

  env.reset(rng, observation_.data());
  keep();
  while (!episode.terminated && !episode.truncated) {
    policy(observations_.data(), 1, actions_.data());
    const std::optional<Step> step = this->step(0, actions_.data(), rng);
    if (!step) {
      episode.truncated = true;
      break;
    }
    keep();
    episode.actions.insert(episode.actions.end(), actions_.begin(),
                           actions_.begin() + static_cast<std::ptrdiff_t>(action_size_));
    episode.rewards.push_back(step->evaluatedReward());
    episode.terminated = step->terminated;
    episode.truncated = step->truncated;
  }
  return episode;
}

}  // namespace pmeta
