#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/act/rollout.h"

namespace pmeta {

/// Environments of one task that serve evaluation only: one for each episode.
class Evaluation {
 public:
  /// `envs`: at least one, all of one task.
  explicit Evaluation(std::vector<std::unique_ptr<Env>> envs);

  /// Of one run(): the number of environments.
  int episodes() const { return static_cast<int>(rollout_.size()); }

  /// Undiscounted returns of one episode in each environment. They run in step, so that the actor
  /// sees them as one batch; all starts are drawn before the first step and thus, of an actor that
  /// draws nothing, depend on `rng` only. An episode that breaks down counts with its return until
  /// then.
  ReturnStats run(Actor& actor, Rng& rng);

  /// One episode, from the start that the first episode of run() has at the same `rng`. Where it
  /// breaks down it is truncated, without the step that broke it. Throws BrokenEpisode if there is
  /// not even a start.
  Episode record(Actor& actor, Rng& rng);

  /// One episode for what the actor observes of it. False if it broke down.
  bool explore(Actor& actor, Rng& rng);

 private:
  Rollout rollout_;
};

}  // namespace pmeta
