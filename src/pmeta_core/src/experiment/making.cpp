// What an experiment's learner is, and how it is made.
#include <new>
#include <stdexcept>

#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/personal/dqn_personal_learner.h"
#include "pmeta_core/personal/sac_personal_learner.h"

namespace pmeta {

void Experiment::bindLearner(Settings& s, const std::string& learner) {
  ExperimentSettings& e = settings_;
  if (learner == "q_learning") return pmeta::bind(s, "q_learning.", e.q_learning);
  s.bind("personal.learning_rate", e.personal.learning_rate, "Adam's learning rate",
         Range::above(0));
  s.bind("personal.proximal", e.personal.proximal,
         "the pull after Adam's step, or in the gradient that Adam gets", {"decoupled", "coupled"});
  if (learner == "dqn") pmeta::bind(s, "dqn.", e.dqn);
  if (learner != "sac") return;
  const Range own = Range::atLeast(-1);
  s.bind("personal.lambda_actor", e.personal.lambda_actor,
         "the actor's own strength; -1: lambda; 0: the actor is neither reset nor shared", own);
  s.bind("personal.lambda_critic", e.personal.lambda_critic, "the same for both critics", own);
  s.bind("personal.lambda_encoder", e.personal.lambda_encoder, "the same for the inference network",
         own);
  pmeta::bind(s, "sac.", e.sac);
}

void Experiment::checkSampling() const {
  const DqnSettings& dqn = settings_.dqn;
  if (settings_.learner != "dqn" || dqn.warm_up_steps >= dqn.n_step) return;
  throw Error("dqn.warm_up_steps is " + std::to_string(dqn.warm_up_steps) + " but dqn.n_step is " +
              std::to_string(dqn.n_step) + ": nothing could be sampled; give at least as many.");
}

int Experiment::numTestTasks() const {
  // a one-hot input has no place for a task that was not trained on
  const bool can_serve = settings_.learner != "sac" || settings_.sac.task_encoding != "one_hot";
  return evaluatesMeta() && can_serve ? family_->numTestTasks() : 0;
}

std::vector<int> Experiment::contextEpisodes() const {
  std::vector<int> counts = {0};
  if (settings_.learner != "sac" || settings_.sac.task_encoding != "inference") return counts;
  for (const int count : settings_.sac.context.exploration_episodes) counts.push_back(count);
  return counts;
}

std::unique_ptr<PersonalLearner> Experiment::makeLearner(int task) const {
  const auto refuse = [&]() -> Error {
    const auto settings = flatSettings(parseYaml(yaml_, "the settings"));
    std::vector<std::string> large;
    for (const char* name : {"buffer_size", "hidden", "num_envs", "batch_size"}) {
      const auto setting = settings.find(settings_.learner + "." + name);
      if (setting != settings.end()) large.push_back(setting->first + " = " + setting->second);
    }
    return Error("the learner of a task does not fit into this machine's memory: lower " +
                 join(large) + ".");
  };
  try {
    return makeLearnerUnguarded(task);
  } catch (const std::bad_alloc&) {
    throw refuse();
  } catch (const std::length_error&) {
    throw refuse();
  }
}

std::unique_ptr<PersonalLearner> Experiment::makeLearnerUnguarded(int task) const {
  const ExperimentSettings& e = settings_;
  if (e.learner != "q_learning") {
    ProximalAdamSettings optimizer;
    optimizer.learning_rate = e.personal.learning_rate;
    optimizer.alpha = e.personal.alpha;
    optimizer.lambda = e.personal.lambda;
    optimizer.eta = e.personal.eta;
    optimizer.coupled = e.personal.proximal == "coupled";
    const auto make_env = [family = family_, task] { return family->make(task); };
    if (e.learner == "dqn") {
      const auto updates = static_cast<std::int64_t>(e.rounds) * e.updates_per_round;
      if (!algorithm_->pools_environments) {
        return std::make_unique<DqnPersonalLearner>(make_env, e.dqn, optimizer, updates);
      }
      const auto of_all_tasks = [family = family_](int k) {
        return family->make(k % family->numTasks());
      };
      return std::make_unique<DqnPersonalLearner>(make_env, e.dqn, optimizer, updates,
                                                  of_all_tasks);
    }
    const SacLambdas lambdas = {e.personal.lambda_actor, e.personal.lambda_critic,
                                e.personal.lambda_encoder};
    SacSettings sac = e.sac;
    // nothing is learnt on a test task: no replay
    if (isTestTask(task)) sac.buffer_size = sac.batch_size;
    // where nothing comes back the first meta-policy would explore for ever
    if (!evaluatesMeta()) sac.context.explorer = "personal";
    return std::make_unique<SacPersonalLearner>(make_env, sac, optimizer, task, numTasks(),
                                                lambdas);
  }
  std::unique_ptr<Env> env = family_->make(task);
  auto* tabular = dynamic_cast<TabularEnv*>(env.get());
  if (tabular == nullptr) {
    throw Error("environment '" + e.environment +
                "' is not tabular, so q_learning cannot learn it: choose learner:=dqn.");
  }
  env.release();
  return std::make_unique<TabularPersonalLearner>(std::unique_ptr<TabularEnv>(tabular),
                                                  e.q_learning, e.personal);
}

std::optional<double> Experiment::optimalReturn(int task) const {
  std::call_once(optima_->computed, [this] {
    for (int k = 0; k < totalTasks(); ++k) {
      const std::unique_ptr<Env> env = family_->make(k);
      const auto* tabular = dynamic_cast<const TabularEnv*>(env.get());
      optima_->returns.emplace_back();
      if (tabular != nullptr) optima_->returns.back() = pmeta::optimalReturn(*tabular).mean;
    }
  });
  return optima_->returns.at(static_cast<std::size_t>(task));
}

}  // namespace pmeta
