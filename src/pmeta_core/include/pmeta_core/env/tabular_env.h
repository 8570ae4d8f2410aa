#pragma once

#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// One possible result of acting: p(s', r | s, a).
struct Outcome {
  int next_state = 0;       ///< s', a row of the shared table
  double probability = 1;   ///< of this outcome, positive
  double reward = 0;        ///< r, which comes with it
  bool terminated = false;  ///< is s' a terminal state?
};

/// A finite MDP with a known model, one task out of a family that shares one table of states.
///
/// State indices are rows of the family's table (the union of all tasks' states); a task owns the
/// states in which it can act. Terminal states are not owned: they have no action values.
class TabularEnv : public Env {
 public:
  virtual int numStates() const = 0;                        ///< rows of the shared table
  virtual const std::vector<int>& ownedStates() const = 0;  ///< ascending
  /// What acting in an owned state may give; the probabilities sum to 1.
  virtual const std::vector<Outcome>& outcomes(int state, int action) const = 0;
  /// The row of the shared table that an observation of this task stands for.
  virtual int stateOf(const double* observation) const = 0;

  int numActions() const { return spec().num_actions; }  ///< the same in every state

  /// Draws an outcome of (state, action); a certain outcome draws nothing.
  const Outcome& sample(int state, int action, Rng& rng) const;
};

}  // namespace pmeta
