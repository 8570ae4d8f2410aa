#pragma once

#include <cstdint>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/rng.h"
#include "pmeta_core/learn/tabular.h"
#include "pmeta_core/personal/personal_settings.h"

namespace pmeta {

/// One evaluation episode, for people to look at. Never part of what training exchanges.
struct Episode {
  int observation_size = 0;
  int action_size = 0;
  std::vector<double> observations;  ///< (steps + 1) x observation_size, row-major
  std::vector<double> actions;       ///< steps x action_size, row-major
  std::vector<double> rewards;       ///< steps
  int position_size = 0;
  std::vector<double> positions;  ///< (steps + 1) x position_size, see Env::configuration()
  bool terminated = false;
  bool truncated = false;
  std::vector<double> state_values;  ///< tabular tasks: max_a Q(s,a) by state, NaN where not owned
  std::vector<std::int32_t> greedy_actions;  ///< tabular tasks: argmax_a Q(s,a), -1 where not owned
  int action_grid = 0;  ///< actions along each axis of `action_values`; 0: there are none
  std::vector<float>
      action_values;  ///< two-dimensional actions: Q at the start, see actionValues()
};

/// What one personalised update cost and gave.
struct UpdateStats {
  std::int64_t env_steps = 0;        ///< environment transitions
  std::int64_t updates = 0;          ///< personalised updates
  std::int64_t broken_episodes = 0;  ///< whose simulation broke down
  double loss = 0;                   ///< the learner's own measure; for tables the mean |TD error|
};

/// Return of a policy that was given some exploration episodes to find out about the task.
struct AdaptedReturn {
  int context_episodes = 0;  ///< how many; 0: before any
  ReturnStats stats;
  std::vector<float> task_input = {};  ///< what it knew then; empty without an inference network
};

/// A learner bound to one task with its personal parameters phi and auxiliary parameters omega.
class PersonalLearner {
 public:
  virtual ~PersonalLearner() = default;

  virtual const ModelLayout& layout() const = 0;

  /// The parameters every party begins with; depends on `seed` only, the same for all tasks.
  virtual Model initialModel(std::uint64_t seed) const = 0;

  /// Takes the meta-policy: omega <- meta, and phi <- meta unless phi is kept.
  virtual void beginRound(const Model& meta, bool keep_personal) = 0;

  /// One of the R iterations: personalised update (K steps), then auxiliary update.
  virtual UpdateStats update(Rng& rng) = 0;

  /// Parameters with this task's presence mask.
  virtual const Model& personal() const = 0;
  virtual const Model& auxiliary() const = 0;

  /// Return of `policy` on this task, greedy, by the protocol of the environment.
  virtual ReturnStats evaluate(const Model& policy, Rng& rng) const = 0;

  /// What tells `policy` the task beside the observations, as far as this learner knows; empty if
  /// nothing does.
  virtual std::vector<float> taskInput(const Model& policy) const {
    static_cast<void>(policy);
    return {};
  }

  /// Returns of a meta-policy on this task, for each number of exploration episodes that the
  /// learner's settings name, ascending. A learner without an inference network has no use for any:
  /// one return.
  virtual std::vector<AdaptedReturn> evaluateAdapted(const Model& policy, Rng& rng) const {
    return {{0, evaluate(policy, rng)}};
  }

  /// One greedy episode of `policy` from a start drawn by `rng`.
  virtual Episode record(const Model& policy, Rng& rng) const = 0;

  /// The same of a policy that knows what it knew in `adapted`, which evaluateAdapted() gave: with
  /// its `rng`, the first of the episodes behind that return.
  virtual Episode recordAdapted(const Model& policy, const AdaptedReturn& adapted, Rng& rng) const {
    static_cast<void>(adapted);
    return record(policy, rng);
  }

  /// All that later rounds depend on, between two updates: parameters, optimiser, replay, target
  /// networks, environments. Loaded by a learner of the same settings and task, it goes on bit for
  /// bit as this one.
  virtual void saveState(StateWriter& writer) const = 0;
  virtual void loadState(StateReader& reader) = 0;
};

}  // namespace pmeta
