#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/env/env.h"

namespace pmeta {

/// What one step in one environment gave. It points into the rollout: valid during the call.
struct Experience {
  std::size_t env;                ///< which one
  const float* observation;       ///< that was acted on
  const double* action;           ///< as Env::step() took it
  Step step;                      ///< reward, and whether the episode ended
  const float* next_observation;  ///< where the step led, of a terminal state too
};

/// Acts in environments that are stepped side by side, and may remember what comes of it: as it
/// acts, look() and act() for each step, begin() before an episode, observe() after a step.
class Actor {
 public:
  virtual ~Actor() = default;

  /// An episode has begun in environment `env`. Nothing, where all episodes are acted in alike.
  virtual void begin(std::size_t env, Rng& rng) {
    static_cast<void>(env);
    static_cast<void>(rng);
  }

  /// Takes in where the environments `envs` are: observations [envs.size(), observation_size].
  virtual void look(const float* observations, const std::vector<std::size_t>& envs) = 0;

  /// Writes the action in the row-th of those. False, and no action, where the actor knows none.
  virtual bool act(std::size_t row, Rng& rng, double* action) = 0;

  /// What came of it. Nothing, where the actor acts on the observation alone.
  virtual void observe(const Experience& experience) { static_cast<void>(experience); }
};

}  // namespace pmeta
