#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/act/broken_episodes.h"
#include "pmeta_core/act/step_guard.h"

namespace pmeta {

/// Environments of one kind that an actor is stepped in side by side: the one loop in which
/// training, exploration, evaluation and recording act.
class Rollout {
 public:
  /// Where an episode has come to its end.
  enum class AtEnd { kBeginAnother, kStop };

  /// `forgiven`: how many episodes running may break down; see BrokenEpisodes.
  Rollout(std::vector<std::unique_ptr<Env>> envs, AtEnd at_end, int forgiven);

  /// Begins an episode in each of the first `count` environments, in their order.
  void begin(std::size_t count, Actor& actor, Rng& rng);

  /// One step in each environment whose episode goes on: the actor looks at all, then acts in one
  /// after the other. With kBeginAnother, an episode that somebody else has ended, or that could
  /// not be restored, makes place for another first. Of a step that breaks its episode nothing is
  /// kept. Returns the transitions. Allocates nothing. Throws Error where the actor knows no
  /// action, FaultyEnv as StepGuard does.
  std::int64_t step(Actor& actor, Rng& rng);

  bool running() const { return !running_.empty(); }  ///< does any episode go on?

  std::size_t size() const { return envs_.size(); }          ///< environments
  const Env& env(std::size_t i) const { return *envs_[i]; }  ///< in the order they were given in
  /// Where environment i is: spec().observation_size numbers.
  const double* observation(std::size_t i) const { return &observations_[i * observation_size_]; }
  /// What was done there last: spec().action_size numbers.
  const double* action(std::size_t i) const { return &actions_[i * action_size_]; }
  /// What that gave.
  const Step& taken(std::size_t i) const { return steps_[i]; }
  /// Return of the episode in environment i, as policies are judged.
  double returned(std::size_t i) const { return returns_[i]; }
  const BrokenEpisodes& broken() const { return broken_; }  ///< counts of all environments together
  BrokenEpisodes& broken() { return broken_; }              ///< the same, to load a state into

  /// With kBeginAnother, in the middle of episodes: where the environments are, as floats under
  /// `observations`, and their states, each under its one of `env_names`.
  void saveEpisodes(StateWriter& writer, const std::string& observations,
                    const std::vector<std::string>& env_names) const;
  /// Goes on from there, but with new episodes where environments are not restorable. Throws Error
  /// where Env::loadState() does, or the sizes differ.
  void loadEpisodes(StateReader& reader, const std::string& observations,
                    const std::vector<std::string>& env_names);

 private:
  bool beginEpisode(std::size_t i, Actor& actor, Rng& rng);
  void replaceInterrupted(Actor& actor, Rng& rng);
  bool stepOne(std::size_t row, Actor& actor, Rng& rng, std::int64_t& transitions);
  void place(std::size_t i, std::size_t row);

  std::vector<std::unique_ptr<Env>> envs_;
  AtEnd at_end_;
  BrokenEpisodes broken_;
  std::size_t observation_size_;
  std::size_t action_size_;
  StepGuard guard_;
  std::vector<std::size_t> running_;  // environments whose episode goes on, ascending
  std::vector<float> seen_;           // where those are, packed: what the actor looks at
  std::vector<float> next_seen_;      // of one environment
  // of all environments
  std::vector<double> observations_;
  std::vector<double> actions_;
  std::vector<Step> steps_;
  std::vector<double> returns_;
  std::vector<bool> unrestored_;
};

}  // namespace pmeta
