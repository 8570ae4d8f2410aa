#include "pmeta_core/act/rollout.h"

#include <algorithm>
#include <utility>

#include "pmeta_core/base/error.h"

namespace pmeta {

Rollout::Rollout(std::vector<std::unique_ptr<Env>> envs, AtEnd at_end, int forgiven)
    : envs_(std::move(envs)),
      at_end_(at_end),
      broken_(forgiven),
      observation_size_(static_cast<std::size_t>(envs_.front()->spec().observation_size)),
      action_size_(static_cast<std::size_t>(envs_.front()->spec().action_size)),
      guard_(observation_size_, action_size_),
      seen_(envs_.size() * observation_size_),
      next_seen_(observation_size_),
      observations_(envs_.size() * observation_size_),
      actions_(envs_.size() * action_size_),
      steps_(envs_.size()),
      returns_(envs_.size()),
      unrestored_(envs_.size()) {
  running_.reserve(envs_.size());
}

void Rollout::begin(std::size_t count, Actor& actor, Rng& rng) {
  running_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (!beginEpisode(i, actor, rng)) continue;
    place(i, running_.size());
    running_.push_back(i);
  }
}

// false: it broke down at its start, and no other is begun
bool Rollout::beginEpisode(std::size_t i, Actor& actor, Rng& rng) {
  for (;;) {
    try {
      returns_[i] = 0;
      guard_.reset(*envs_[i], rng, &observations_[i * observation_size_]);
      break;
    } catch (const BrokenEpisode& episode) {
      broken_.broke(episode);
      if (at_end_ == AtEnd::kStop) return false;
    }
  }
  actor.begin(i, rng);
  return true;
}

void Rollout::replaceInterrupted(Actor& actor, Rng& rng) {
  for (std::size_t row = 0; row < running_.size(); ++row) {
    const std::size_t i = running_[row];
    if (!unrestored_[i] && !envs_[i]->interrupted()) continue;
    unrestored_[i] = false;
    beginEpisode(i, actor, rng);
    place(i, row);
  }
}

void Rollout::place(std::size_t i, std::size_t row) {
  std::copy_n(observation(i), observation_size_, &seen_[row * observation_size_]);
}

std::int64_t Rollout::step(Actor& actor, Rng& rng) {
  if (at_end_ == AtEnd::kBeginAnother) replaceInterrupted(actor, rng);
  actor.look(seen_.data(), running_);
  std::int64_t transitions = 0;
  std::size_t kept = 0;
  for (std::size_t row = 0; row < running_.size(); ++row) {
    const std::size_t i = running_[row];
    if (!stepOne(row, actor, rng, transitions)) continue;
    // close up: kept <= row, so nothing unread is overwritten
    running_[kept] = i;
    place(i, kept++);
  }
  running_.resize(kept);
  return transitions;
}

// is there an episode that goes on?
bool Rollout::stepOne(std::size_t row, Actor& actor, Rng& rng, std::int64_t& transitions) {
  const std::size_t i = running_[row];
  double* action = &actions_[i * action_size_];
  if (!actor.act(row, rng, action)) {
    throw Error("the policy knows no action where an episode of " + envs_[i]->spec().name +
                " has come to.");
  }
  double* next = &observations_[i * observation_size_];
  const bool another = at_end_ == AtEnd::kBeginAnother;
  try {
    steps_[i] = guard_.step(*envs_[i], action, rng, next);
  } catch (const BrokenEpisode& episode) {
    broken_.broke(episode);
    return another && beginEpisode(i, actor, rng);
  }
  const Step& step = steps_[i];
  ++transitions;
  returns_[i] += step.evaluatedReward();
  std::copy_n(next, observation_size_, next_seen_.begin());
  actor.observe({i, &seen_[row * observation_size_], action, step, next_seen_.data()});
  if (!step.terminated && !step.truncated) return true;
  broken_.ended();
  return another && beginEpisode(i, actor, rng);
}

void Rollout::saveEpisodes(StateWriter& writer, const std::string& observations,
                           const std::vector<std::string>& env_names) const {
  writer.array(observations, seen_);
  for (std::size_t i = 0; i < envs_.size(); ++i) writer.part(env_names[i], *envs_[i]);
}

void Rollout::loadEpisodes(StateReader& reader, const std::string& observations,
                           const std::vector<std::string>& env_names) {
  reader.array(observations, seen_);
  running_.resize(envs_.size());
  for (std::size_t i = 0; i < envs_.size(); ++i) {
    running_[i] = i;
    unrestored_[i] = !envs_[i]->spec().restorable;
    reader.part(env_names[i], *envs_[i]);
  }
}

}  // namespace pmeta
