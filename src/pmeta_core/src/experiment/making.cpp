// What is made of an experiment's settings.
#include <new>
#include <stdexcept>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/tabular_env.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/learn/tabular.h"

namespace pmeta {

int Experiment::numTestTasks() const {
  return evaluatesMeta() && learner_->servesTestTasks() ? family_->numTestTasks() : 0;
}

std::vector<int> Experiment::contextEpisodes() const {
  std::vector<int> counts = {0};
  for (const int count : learner_->explorationEpisodes()) counts.push_back(count);
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
    LearnerTask order;
    order.family = family_;
    order.task = task;
    order.trains = !isTestTask(task);
    order.shares = evaluatesMeta();
    order.pools = algorithm_->pools_environments;
    order.total_updates = static_cast<std::int64_t>(settings_.rounds) * settings_.updates_per_round;
    return std::make_unique<PersonalLearner>(learner_->make(order), settings_.personal);
  } catch (const std::bad_alloc&) {
    throw refuse();
  } catch (const std::length_error&) {
    throw refuse();
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
