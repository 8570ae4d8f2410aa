#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/base/registry.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/learner.h"

namespace pmeta {

/// What one iteration of a meta-learner cost.
struct IterationStats {
  std::vector<std::int64_t> env_steps;  ///< transitions made for learning, by training task
  std::int64_t updates = 0;             ///< of the meta-policy's parameters
  std::int64_t broken_episodes = 0;     ///< whose simulation broke down
};

/// What learns one meta-policy from the trajectories of all training tasks, which meet in it: the
/// methods that personalised meta reinforcement learning is compared with.
class MetaLearner {
 public:
  MetaLearner() = default;
  MetaLearner(const MetaLearner&) = delete;
  MetaLearner& operator=(const MetaLearner&) = delete;
  virtual ~MetaLearner() = default;

  /// What the meta-policy's parameters are of.
  virtual const PolicyFamily& policies() const = 0;

  /// The meta-policy's parameters.
  virtual const Model& model() const = 0;

  /// Takes parameters to begin with, or to go on from where somebody else changed them.
  virtual void setModel(const Model& model) = 0;

  /// One whole iteration of the method. Its draws depend on `seed` and `iteration` (from 0) alone:
  /// each task's generators are Rng(seed, task, stream, iteration). Throws BrokenEpisode where ten
  /// episodes running broke down.
  virtual IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) = 0;

  /// Of the last iteration; the first is the method's own measure of success.
  virtual const std::vector<Loss>& losses() const = 0;

  /// How `policy`, which must outlive it, gets to know the task that it is to act on. Which that is
  /// only those go by that are told: `task` is one of training where servesTestTasks() is false.
  virtual std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const = 0;

  /// All but the model that later iterations depend on, between two of them.
  virtual void saveState(StateWriter& writer) const = 0;
  /// Refuses what no saveState() of one with these settings gives.
  virtual void loadState(StateReader& reader) = 0;
};

/// What a meta-learner is made for: the tasks of an experiment.
struct MetaTasks {
  std::shared_ptr<const EnvFamily> family;  ///< whose first numTasks() are trained on
  std::int64_t total_steps = 0;  ///< transitions of the whole run, over all training tasks
  int threads = 1;               ///< that may act in environments at the same time

  int count() const { return family->numTasks(); }  ///< that are trained on, from 0
};

/// A kind of meta-learner with its settings: how they are read and checked, and what is made.
class MetaLearnerKind {
 public:
  virtual ~MetaLearnerKind() = default;

  /// Binds its own settings below "<name>.".
  virtual void bind(Settings& settings) = 0;

  /// Throws Error on settings that do not go together, or not with so many training tasks.
  virtual void check(int num_tasks) const = 0;

  /// Asks for matrix products that are the same on every processor.
  virtual void setPortable(bool portable) = 0;

  /// How many exploration episodes a meta-policy is evaluated after, beside none; ascending.
  virtual std::vector<int> explorationEpisodes() const = 0;

  /// How many episodes one evaluation is the mean of.
  virtual int evaluationEpisodes() const = 0;

  /// Throws Error where it cannot learn in such environments.
  virtual std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const = 0;

  /// Its policies for the environment `env`, which must outlive them; `num_tasks` are trained on.
  /// Throws as make().
  virtual std::unique_ptr<PolicyFamily> policies(const Env& env, int num_tasks) const = 0;

  /// How a meta-policy, which must outlive it, gets to know a task by exploring it; null where it
  /// does not. `policies`, of this kind, must outlive it, as this must.
  virtual std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                                 const Model& policy) const {
    static_cast<void>(policies);
    static_cast<void>(policy);
    return nullptr;
  }

  /// Can the meta-policy act on tasks that were not trained on?
  virtual bool servesTestTasks() const { return true; }

  /// What tells a meta-policy that has not explored to act on `task`, see
  /// PolicyFamily::taskInputSize(); nothing if it must be told one of `num_tasks` and `task` is
  /// none.
  virtual std::optional<std::vector<float>> metaInput(int task, int num_tasks) const {
    static_cast<void>(task);
    static_cast<void>(num_tasks);
    return std::vector<float>();
  }
};

/// A row of the registry of meta-learners.
struct MetaLearnerRow {
  std::string label;     ///< for figures and tables, e.g. "PEARL"
  std::string meaning;   ///< a clause, for the list of settings
  std::string policies;  ///< what policy files hold, for scripts: see manifest.h
  std::function<std::unique_ptr<MetaLearnerKind>()> make;  ///< one with default settings
};

/// Every kind of meta-learner, by the name that `algorithm` gives.
Registry<MetaLearnerRow>& metaLearners();

/// Makes a kind known under a name, beside its code:
///
///     const RegisteredMetaLearner<PearlKind> kPearl("pearl", "PEARL", "what it does", "...");
template <class Kind>
struct RegisteredMetaLearner : Registered<MetaLearnerRow> {
  /// As in MetaLearnerRow.
  RegisteredMetaLearner(const std::string& name, const std::string& label,
                        const std::string& meaning, const std::string& policies)
      : Registered(metaLearners(), name,
                   {label, meaning, policies, [] { return std::make_unique<Kind>(); }}) {}
};

}  // namespace pmeta
