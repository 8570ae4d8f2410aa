#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "pmeta_core/adapt/adapted_return.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/learn/learner.h"
#include "pmeta_core/personal/personal_settings.h"
#include "pmeta_core/personal/proximal_adam.h"
#include "pmeta_core/personal/proximal_sgd.h"

namespace pmeta {

/// What a personal learner is made of.
struct PersonalParts {
  std::unique_ptr<Learner> learner;                   ///< of the task; not null
  std::vector<std::unique_ptr<Env>> evaluation_envs;  ///< see Evaluation
  bool reset_moments = false;                         ///< the optimiser begins anew with each round
  /// Makes what a meta-policy gets to know a task by; null: it is told what the learner knows.
  std::function<std::unique_ptr<Adaptation>(const Model& policy)> adapt = {};
  std::vector<int> exploration_episodes = {};  ///< it is evaluated after so many; ascending
  int evaluation_episodes = 0;                 ///< of an evaluation; see Evaluation
};

/// A learner bound to one task with its personal parameters phi and auxiliary parameters omega, and
/// the optimiser that pulls phi towards omega (pMeta-RL): ProximalSgd for tables, ProximalAdam for
/// networks.
///
/// A round resets parameters only. All else is the learner's own and goes on from round to round,
/// but for what its settings say.
class PersonalLearner {
 public:
  /// Throws Error where ProximalAdam does.
  PersonalLearner(PersonalParts parts, const PersonalSettings& settings);

  /// The layout of personal, auxiliary and meta-parameters alike.
  const ModelLayout& layout() const { return parts_.learner->policies().layout(); }

  /// The parameters every party begins with; depends on `seed` only, the same for all tasks.
  Model initialModel(std::uint64_t seed) const;

  /// Takes the meta-policy: omega <- meta, and phi <- meta unless phi is kept.
  void beginRound(const Model& meta, bool keep_personal);

  /// One of the R iterations: personalised update (K steps), then auxiliary update. Allocates
  /// nothing after the first.
  UpdateStats update(Rng& rng);

  /// Of the last update, see Learner::losses().
  const std::vector<Loss>& losses() const { return parts_.learner->losses(); }

  /// Parameters with this task's presence mask.
  const Model& personal() const { return personal_; }
  const Model& auxiliary() const { return auxiliary_; }  ///< omega, with the same mask

  /// Return of `policy` on this task, greedy: exact where the learner knows the task's model, else
  /// the mean over one episode in each evaluation environment, whose starts depend on `rng` only.
  ReturnStats evaluate(const Model& policy, Rng& rng) const {
    return evaluate(policy, taskInput(policy), rng);
  }
  /// The same of a policy that is told `task_input`.
  ReturnStats evaluate(const Model& policy, const std::vector<float>& task_input, Rng& rng) const;

  /// What tells `policy` the task beside the observations, as far as this learner knows; empty if
  /// nothing does.
  std::vector<float> taskInput(const Model& policy) const {
    return parts_.learner->taskInput(policy);
  }

  /// Returns of a meta-policy on this task as at test time: before it has explored, and after each
  /// number of exploration episodes that there is, ascending. Where it does not explore: one
  /// return. Evaluations start alike.
  std::vector<AdaptedReturn> evaluateAdapted(const Model& policy, Rng& rng) const;

  /// One greedy episode of `policy` from a start drawn by `rng`.
  Episode record(const Model& policy, Rng& rng) const;

  /// The same of a policy that knows what it knew in `adapted`, which evaluateAdapted() gave: with
  /// its `rng`, the first of the episodes behind that return.
  Episode recordAdapted(const Model& policy, const AdaptedReturn& adapted, Rng& rng) const {
    Episode episode = recordWith(policy, adapted.task_input, rng);
    episode.task_weights = adapted.task_weights;
    return episode;
  }

  /// What PersonalParts gave, for tests and measurements.
  const Learner& learner() const { return *parts_.learner; }
  const ProximalAdam& adam() const { return std::get<ProximalAdam>(optimizer_); }  ///< of networks

  /// All that later rounds depend on, between two updates: parameters, optimiser, and the learner's
  /// state. Loaded by a learner of the same settings and task, it goes on bit for bit as this one.
  void saveState(StateWriter& writer) const;
  /// Throws Error where the model, optimiser or learner refuses its part.
  void loadState(StateReader& reader);

 private:
  using Pull = std::variant<ProximalSgd<double>, ProximalAdam>;

  static Pull makePull(Model& personal, Model& auxiliary, const PersonalSettings& settings);
  Episode recordWith(const Model& policy, const std::vector<float>& task_input, Rng& rng) const;

  PersonalParts parts_;
  std::unique_ptr<Evaluation> evaluation_;
  Model personal_;
  Model auxiliary_;
  bool has_personal_ = false;
  std::vector<std::pair<std::size_t, std::size_t>> own_;  // [begin, end) that no round resets
  Pull optimizer_;
};

}  // namespace pmeta
