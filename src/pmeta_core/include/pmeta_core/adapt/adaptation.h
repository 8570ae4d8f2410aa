#pragma once

#include <vector>

#include "pmeta_core/act/actor.h"

namespace pmeta {

/// How a policy gets to know the task it is to act on, step by step: it is the actor of exploration
/// episodes, in one environment, and observes what comes of them.
class Adaptation : public Actor {
 public:
  /// An exploration episode is about to begin: makes a guess at the task.
  virtual void beginEpisode(Rng& rng) = 0;

  /// The exploration episode at hand has come to its end, or has broken down.
  virtual void episodeOver() = 0;

  /// What the policy is to be told of the task by what is known so far: see
  /// PolicyFamily::taskInputSize().
  virtual std::vector<float> taskInput() const = 0;
};

}  // namespace pmeta
