#pragma once

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/learn/loss.h"
#include "pmeta_core/learn/optimizer.h"

namespace pmeta {

/// An optimiser of parameters in either precision, as a Model has them.
using AnyOptimizer = std::variant<Optimizer<float>*, Optimizer<double>*>;

/// What one update cost and gave.
struct UpdateStats {
  std::int64_t env_steps = 0;        ///< environment transitions
  std::int64_t updates = 0;          ///< updates of the parameters
  std::int64_t broken_episodes = 0;  ///< whose simulation broke down
  double loss = 0;                   ///< the first of Learner::losses()
};

/// What learns one task from its environments: an update rule and the data that it collects. The
/// parameters belong to the caller, who passes them in with an optimiser that moves them; the
/// learner knows nothing of personalisation.
class Learner {
 public:
  Learner() = default;
  Learner(const Learner&) = delete;
  Learner& operator=(const Learner&) = delete;
  virtual ~Learner() = default;

  /// What the parameters are of.
  virtual const PolicyFamily& policies() const = 0;

  /// Parameters of zero, of which those are absent that are only other tasks'.
  virtual Model blank() const = 0;

  /// A round begins with that meta-policy; `first`: the learner's first one.
  virtual void beginRound(const Model& meta, bool first) = 0;

  /// Collects, and updates `parameters` through `optimizer`. Allocates nothing after the first
  /// call.
  virtual UpdateStats learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) = 0;

  /// Of the last update, always the same names; the first is its own measure of success.
  virtual const std::vector<Loss>& losses() const = 0;

  /// What tells `policy` the task beside the observations, as far as this learner knows.
  virtual std::vector<float> taskInput(const Model& policy) const = 0;

  /// Return of the greedy `policy` where the task's model is known; else nothing: try it out.
  virtual std::optional<ReturnStats> exactReturn(const Model& policy) const = 0;

  /// Adds to an episode of `policy` what people may want to see of its values.
  virtual void addValues(const Model& policy, const std::vector<float>& task_input,
                         Episode& episode) const = 0;

  /// All but parameters and optimiser that later updates depend on.
  virtual void saveState(StateWriter& writer) const = 0;
  /// Goes on from what a learner of the same settings and task has saved; throws Error on anything
  /// else.
  virtual void loadState(StateReader& reader) = 0;
};

}  // namespace pmeta
