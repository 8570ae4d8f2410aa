#include "pmeta_core/learn/tabular_learner.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace pmeta {

void bind(Settings& s, const std::string& prefix, QLearningSettings& q) {
  s.bind(prefix + "gamma", q.gamma, "discount", Range::halfOpen(0, 1));
  s.bind(prefix + "updates", q.updates, "K: batches before each auxiliary update",
         Range::between(1, 1e6));
  s.bind(prefix + "samples_per_entry", q.samples_per_entry,
         "samples of a batch as a multiple of the entries the task owns",
         Range{0, 1e6, true, false});
  s.bind(prefix + "initial_value", q.initial_value, "Q at the start");
}

TabularLearner::TabularLearner(std::unique_ptr<TabularEnv> env, const QLearningSettings& settings)
    : env_(std::move(env)),
      settings_(settings),
      policies_(*env_, settings.initial_value),
      rule_(*env_, settings.gamma) {}

Model TabularLearner::blank() const {
  Model model(policies_.layout());
  model.present.assign(model.size(), 0);
  const std::size_t n = env_->numActions();
  for (const int s : env_->ownedStates()) {
    std::fill_n(model.present.begin() + static_cast<std::ptrdiff_t>(s * n), n, std::uint8_t{1});
  }
  return model;
}

UpdateStats TabularLearner::learn(const Model& parameters, const AnyOptimizer& optimizer,
                                  Rng& rng) {
  UpdateStats stats;
  for (int k = 0; k < settings_.updates; ++k) {
    const QLearner::BatchStats batch =
        rule_.learnBatch(parameters.doubles(), settings_.samples_per_entry,
                         *std::get<Optimizer<double>*>(optimizer), rng);
    stats.env_steps += batch.samples;
    stats.loss = batch.mean_abs_td_error;
    ++stats.updates;
  }
  losses_.front().value = stats.loss;
  return stats;
}

void TabularLearner::addValues(const Model& policy, const std::vector<float>&,
                               Episode& episode) const {
  const int n = env_->numActions();
  episode.state_values.assign(env_->numStates(), std::numeric_limits<double>::quiet_NaN());
  episode.greedy_actions.assign(env_->numStates(), -1);
  for (const int s : env_->ownedStates()) {
    const double* values = &policy.doubles()[static_cast<std::size_t>(s) * n];
    episode.greedy_actions[s] = greedyAction(values, n);
    episode.state_values[s] = values[episode.greedy_actions[s]];
  }
}

}  // namespace pmeta
