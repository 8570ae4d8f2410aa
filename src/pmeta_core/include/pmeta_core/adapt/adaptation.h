#pragma once

#include <cstddef>
#include <memory>
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

  /// Acts greedily by what is known so far, in up to `max_batch` environments at once, each episode
  /// on its own. What this was made of must outlive it; what is learnt later does not reach it.
  virtual std::unique_ptr<Actor> adapted(std::size_t max_batch) const = 0;

  /// What the policy is told of the task by what is known so far: see
  /// PolicyFamily::taskInputSize(). Nothing, where it gets to know the task in another way.
  virtual std::vector<float> taskInput() const { return {}; }

  /// How likely the task is each of those trained on, by what is known so far, summing up to 1;
  /// nothing, where that is not what is known.
  virtual std::vector<double> taskWeights() const { return {}; }

  /// Do actors of adapted() need to observe what comes of their actions, too?
  virtual bool remembers() const { return false; }
};

}  // namespace pmeta
