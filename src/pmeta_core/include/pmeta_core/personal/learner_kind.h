#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/base/registry.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/env/one_body.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta {

/// What a learner is made for: a task of an experiment.
struct LearnerTask {
  std::shared_ptr<const EnvFamily> family;  ///< built; kept alive by whoever holds this
  int task = 0;                             ///< a training or test task of the family
  bool trains = true;                       ///< false: a test task, on which nothing is learnt
  bool shares = true;               ///< does each round begin with what comes back of all tasks?
  bool pools = false;               ///< does it train in environments of all tasks?
  std::int64_t total_updates = 0;   ///< of the whole run
  std::shared_ptr<OneBody> body{};  ///< of the task, where its family has one body; else null

  /// A new environment of the task, or another handle to its body.
  std::unique_ptr<Env> makeEnv() const { return body ? body->handle() : family->make(task); }
  /// Environments, and how many episodes an evaluation in them has.
  void evaluateOver(int episodes, PersonalParts& parts) const;
};

/// A kind of learner with its settings: how they are read and checked, and what is made of them.
class LearnerKind {
 public:
  virtual ~LearnerKind() = default;

  /// Binds its own settings below "<name>.", and those of `personal` that only some kinds go by.
  virtual void bind(Settings& settings, PersonalSettings& personal) = 0;

  /// Throws Error on settings that do not go together.
  virtual void check() const = 0;

  /// Has it networks? Then their matrix products may be asked to be the same on every processor.
  virtual bool hasNetworks() const = 0;
  /// Asks for that, or no longer; does nothing where there are no networks.
  virtual void setPortable(bool portable) = 0;

  /// The discount of a tabular update, which is a linear map of the parameters; nothing for
  /// networks, of which only the pull is linear.
  virtual std::optional<double> linearDiscount() const = 0;

  /// How many environments a learner trains in, which may be of any tasks; 0: in one of its own.
  virtual int trainingEnvs() const = 0;

  /// How many exploration episodes a meta-policy is evaluated after, ascending; none where it is
  /// told the task, or acts alike on all.
  virtual std::vector<int> explorationEpisodes() const = 0;

  /// Can a meta-policy act on tasks that were not trained on?
  virtual bool servesTestTasks() const = 0;

  /// What makes a personal learner of the task, with its environments. Throws Error where the kind
  /// cannot learn in such environments.
  virtual PersonalParts make(const LearnerTask& task) const = 0;

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

  /// What tells a meta-policy that has not explored to act on training task `task`; nothing if it
  /// must be told one of `num_tasks` and `task` is none.
  virtual std::optional<std::vector<float>> metaInput(int task, int num_tasks) const = 0;
};

/// A row of the registry of learners.
struct LearnerRow {
  std::string meaning;   ///< a clause, for the list of settings
  std::string policies;  ///< what policy files hold, for scripts: see manifest.h
  std::function<std::unique_ptr<LearnerKind>()> make;  ///< with default settings
};

/// Every kind of learner, by the name that `learner` gives.
Registry<LearnerRow>& learners();

/// Makes a kind known under a name, beside its code:
///
///     const RegisteredLearner<DqnKind> kDqn("dqn", "for networks", "q_network");
template <class Kind>
struct RegisteredLearner : Registered<LearnerRow> {
  /// The columns of a LearnerRow; throws std::logic_error if the name is taken.
  RegisteredLearner(const std::string& name, const std::string& meaning,
                    const std::string& policies)
      : Registered(learners(), name, {meaning, policies, [] { return std::make_unique<Kind>(); }}) {
  }
};

/// The settings that only learners of networks have: Adam's, and how its pull works.
void bindAdam(Settings& settings, PersonalSettings& personal);

}  // namespace pmeta
