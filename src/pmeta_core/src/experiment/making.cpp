// What is made of an experiment's settings.
#include <new>
#include <stdexcept>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/tabular_env.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/learn/tabular.h"

namespace pmeta {

int Experiment::numTestTasks() const {
  const bool serves = hasMetaLearner() ? meta_learner_->servesTestTasks()
                                       : evaluatesMeta() && learner_->servesTestTasks();
  return serves ? family_->numTestTasks() : 0;
}

std::vector<int> Experiment::contextEpisodes() const {
  std::vector<int> counts = {0};
  for (const int count :
       hasMetaLearner() ? meta_learner_->explorationEpisodes() : learner_->explorationEpisodes()) {
    counts.push_back(count);
  }
  return counts;
}

std::int64_t Experiment::stepsPerRound() const {
  if (settings_.steps_per_round > 0) return settings_.steps_per_round;
  return static_cast<std::int64_t>(settings_.updates_per_round) * numTasks();
}

// names the settings of the learner that take memory
void Experiment::refuseMemory() const {
  const auto settings = flatSettings(parseYaml(yaml_, "the settings"));
  const std::string section = hasMetaLearner() ? settings_.algorithm : settings_.learner;
  std::vector<std::string> large;
  for (const char* name :
       {"buffer_size", "hidden", "num_envs", "batch_size", "meta_batch", "episodes"}) {
    const auto setting = settings.find(section + "." + name);
    if (setting != settings.end()) large.push_back(setting->first + " = " + setting->second);
  }
  throw Error(std::string("the learner of ") + (hasMetaLearner() ? "all tasks" : "a task") +
              " does not fit into this machine's memory: lower " + join(large) + ".");
}

std::unique_ptr<MetaLearner> Experiment::makeMetaLearner() const {
  try {
    return meta_learner_->make({family_, stepsPerRound() * settings_.rounds, settings_.threads});
  } catch (const std::bad_alloc&) {
    refuseMemory();
  } catch (const std::length_error&) {
    refuseMemory();
  }
}

Model Experiment::initialModel() const {
  const auto seed = static_cast<std::uint64_t>(settings_.seed);
  if (!hasMetaLearner()) return makeLearner(0)->initialModel(seed);
  const std::unique_ptr<Env> env = family_->make(0);
  const std::unique_ptr<PolicyFamily> policies = meta_learner_->policies(*env, numTasks());
  Model model(policies->layout());
  Rng rng(seed, 0, Stream::kInitialise);
  policies->initialise(model, rng);
  return model;
}

std::unique_ptr<PolicyFamily> Experiment::policies(const Env& env) const {
  return hasMetaLearner() ? meta_learner_->policies(env, numTasks())
                          : learner_->policies(env, numTasks());
}

const std::string& Experiment::policyFiles() const {
  return hasMetaLearner() ? metaLearners().at(settings_.algorithm).policies
                          : learners().at(settings_.learner).policies;
}

std::unique_ptr<Adaptation> Experiment::adaptation(const PolicyFamily& policies,
                                                   const Model& policy) const {
  return hasMetaLearner() ? meta_learner_->adaptation(policies, policy)
                          : learner_->adaptation(policies, policy);
}

std::optional<std::vector<float>> Experiment::metaInput(int task) const {
  if (hasMetaLearner()) return meta_learner_->metaInput(task, numTasks());
  return learner_->metaInput(task, numTasks());
}

std::unique_ptr<PersonalLearner> Experiment::makeLearner(int task) const {
  try {
    LearnerTask order;
    order.family = family_;
    order.task = task;
    order.trains = !isTestTask(task);
    order.shares = evaluatesMeta();
    order.pools = algorithm_->pools_environments;
    if (family_->hasOneBody()) order.body = std::make_shared<OneBody>(family_->make(task));
    order.total_updates = static_cast<std::int64_t>(settings_.rounds) * settings_.updates_per_round;
    return std::make_unique<PersonalLearner>(learner_->make(order), settings_.personal);
  } catch (const std::bad_alloc&) {
    refuseMemory();
  } catch (const std::length_error&) {
    refuseMemory();
  }
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
