#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/act/rollout.h"

namespace pmeta {

/// Environments of one task that serve evaluation only: one for each episode, or fewer that take
/// turns.
class Evaluation {
 public:
  /// `envs`: at least one, all of one task. `episodes`: of one run(); 0: one in each environment.
  explicit Evaluation(std::vector<std::unique_ptr<Env>> envs, int episodes = 0);

  /// In how many environments an actor acts at a time.
  std::size_t width() const { return rollout_.size(); }

  /// Undiscounted returns of so many episodes. One in each environment run in step, so that the
  /// actor sees them as one batch; their starts are drawn before the first step. All starts, of an
  /// actor and environments that draw nothing, depend on `rng` only. An episode that breaks down
  /// counts with its return until then.
  ReturnStats run(Actor& actor, Rng& rng);

  /// One episode, from the start that the first episode of run() has at the same `rng`. Where it
  /// breaks down it is truncated, without the step that broke it. Throws BrokenEpisode if there is
  /// not even a start.
  Episode record(Actor& actor, Rng& rng);

  /// One episode for what the actor observes of it. False if it broke down.
  bool explore(Actor& actor, Rng& rng);

 private:
  Rollout rollout_;
  std::vector<double> returns_;  // of one run()
};

}  // namespace pmeta
