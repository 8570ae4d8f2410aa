#include "pmeta_core/personal/tabular_personal_learner.h"

#include <algorithm>
#include <limits>

namespace pmeta {
namespace {

Model ownedModel(const ModelLayout& layout, const TabularEnv& env) {
  Model model(layout);
  model.present.assign(layout.size(), 0);
  const std::size_t n = env.numActions();
  for (const int s : env.ownedStates()) {
    std::fill_n(model.present.begin() + static_cast<std::ptrdiff_t>(s * n), n, std::uint8_t{1});
  }
  return model;
}

}  // namespace

void bind(Settings& s, const std::string& prefix, QLearningSettings& q) {
  s.bind(prefix + "gamma", q.gamma, "discount", Range::halfOpen(0, 1));
  s.bind(prefix + "updates", q.updates, "K: batches before each auxiliary update",
         Range::between(1, 1e6));
  s.bind(prefix + "samples_per_entry", q.samples_per_entry,
         "samples of a batch as a multiple of the entries the task owns",
         Range{0, 1e6, true, false});
  s.bind(prefix + "initial_value", q.initial_value, "Q at the start");
}

TabularPersonalLearner::TabularPersonalLearner(std::unique_ptr<TabularEnv> env,
                                               const QLearningSettings& q_learning,
                                               const PersonalSettings& personal)
    : env_(std::move(env)),
      q_learning_(q_learning),
      learner_(*env_, q_learning.gamma),
      layout_(Precision::kFloat64, {{"q_table",
                                     {static_cast<std::size_t>(env_->numStates()),
                                      static_cast<std::size_t>(env_->numActions())}}}),
      personal_(ownedModel(layout_, *env_)),
      auxiliary_(personal_),
      optimizer_(personal_.doubles().data(), auxiliary_.doubles().data(), layout_.size(),
                 personal.alpha, personal.lambda, personal.eta) {}

Model TabularPersonalLearner::initialModel(std::uint64_t /*seed*/) const {
  Model model(layout_);
  std::fill(model.doubles().begin(), model.doubles().end(), q_learning_.initial_value);
  return model;
}

void TabularPersonalLearner::beginRound(const Model& meta, bool keep_personal) {
  // copy in place: the optimiser holds the addresses
  const std::vector<double>& values = meta.doubles();
  std::copy(values.begin(), values.end(), auxiliary_.doubles().begin());
  if (!keep_personal || !has_personal_) {
    std::copy(values.begin(), values.end(), personal_.doubles().begin());
  }
  has_personal_ = true;
}

UpdateStats TabularPersonalLearner::update(Rng& rng) {
  UpdateStats stats;
  for (int k = 0; k < q_learning_.updates; ++k) {
    const QLearner::BatchStats batch =
        learner_.learnBatch(personal_.doubles(), q_learning_.samples_per_entry, optimizer_, rng);
    stats.env_steps += batch.samples;
    stats.loss = batch.mean_abs_td_error;
    ++stats.updates;
  }
  optimizer_.moveAuxiliary();
  return stats;
}

ReturnStats TabularPersonalLearner::evaluate(const Model& policy, Rng& /*rng*/) const {
  return evaluateGreedy(*env_, policy.doubles());
}

Episode TabularPersonalLearner::record(const Model& policy, Rng& rng) const {
  const QTable& q = policy.doubles();
  const int n = env_->numActions();
  Episode episode;
  episode.observation_size = env_->spec().observation_size;
  episode.action_size = env_->spec().action_size;

  std::vector<double> observation(episode.observation_size);
  const auto keep = [&] {
    episode.observations.insert(episode.observations.end(), observation.begin(), observation.end());
  };
  env_->reset(rng, observation.data());
  keep();
  while (!episode.terminated && !episode.truncated) {
    const auto row = static_cast<std::size_t>(env_->stateOf(observation.data())) * n;
    const double action = greedyAction(&q[row], n);
    const Step step = env_->step(&action, rng, observation.data());
    keep();
    episode.actions.push_back(action);
    episode.rewards.push_back(step.reward);
    episode.terminated = step.terminated;
    episode.truncated = step.truncated;
  }

  episode.state_values.assign(env_->numStates(), std::numeric_limits<double>::quiet_NaN());
  episode.greedy_actions.assign(env_->numStates(), -1);
  for (const int s : env_->ownedStates()) {
    const double* values = &q[static_cast<std::size_t>(s) * n];
    episode.greedy_actions[s] = greedyAction(values, n);
    episode.state_values[s] = values[episode.greedy_actions[s]];
  }
  return episode;
}

void TabularPersonalLearner::saveState(StateWriter& writer) const {
  writer.flag("has_personal", has_personal_);
  writer.part("personal", personal_);
  writer.part("auxiliary", auxiliary_);
}

void TabularPersonalLearner::loadState(StateReader& reader) {
  has_personal_ = reader.flag("has_personal");
  reader.part("personal", personal_);
  reader.part("auxiliary", auxiliary_);
}

}  // namespace pmeta
