#include "pmeta_core/learn/dqn.h"

#include <cmath>
#include <utility>

namespace pmeta {

DqnLearner::DqnLearner(std::vector<std::unique_ptr<Env>> envs, const DqnSettings& settings,
                       std::int64_t total_updates)
    : settings_(settings),
      policies_(dqnNetwork(envs.front()->spec(), settings)),
      rollout_(std::move(envs), Rollout::AtEnd::kBeginAnother, BrokenEpisodes::kForgiven),
      schedule_{settings.epsilon_start, settings.epsilon_finish,
                settings.epsilon_fraction * static_cast<double>(total_updates)},
      acting_(network(), rollout_.size()),
      replay_(static_cast<std::size_t>(settings.buffer_size), static_cast<int>(network().inputs()),
              1, settings.priority_alpha, settings.priority_beta),
      n_step_(static_cast<int>(rollout_.size()), settings.n_step, settings.gamma,
              static_cast<int>(network().inputs()), 1, settings.bootstrap_at_limit),
      update_(network(), settings) {
  requireSamples(settings);
}

std::int64_t DqnLearner::collect(const float* parameters, Rng& rng) {
  acting_.use(parameters);
  std::int64_t transitions = 0;
  if (!started_) {
    started_ = true;
    rollout_.begin(rollout_.size(), *this, rng);
    epsilon_ = 1;
    for (int t = 0; t < settings_.warm_up_steps; ++t) transitions += rollout_.step(*this, rng);
  }
  epsilon_ = epsilon();
  for (int t = 0; t < settings_.env_steps_per_update; ++t) {
    transitions += rollout_.step(*this, rng);
  }
  // an update needs one, and each episode so far may have broken down
  while (replay_.size() == 0) transitions += rollout_.step(*this, rng);
  return transitions;
}

// nothing waits but of an episode that has not come to its end
void DqnLearner::begin(std::size_t env, Rng&) { n_step_.drop(static_cast<int>(env)); }

void DqnLearner::look(const float* observations, const std::vector<std::size_t>& envs) {
  acting_.look(observations, envs);
}

bool DqnLearner::act(std::size_t row, Rng& rng, double* action) {
  if (rng.uniform() >= epsilon_) return acting_.act(row, rng, action);
  *action = static_cast<double>(rng.below(network().outputs()));
  return true;
}

void DqnLearner::observe(const Experience& e) {
  const auto action = static_cast<float>(*e.action);
  n_step_.add(static_cast<int>(e.env), e.observation, &action, e.step, e.next_observation, replay_);
}

double DqnLearner::update(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  replay_.sample(settings_.batch_size, rng, batch_);
  const double loss = update_.apply(parameters, batch_, optimizer);
  replay_.setPriorities(batch_, update_.tdErrors().data());
  return loss;
}

void DqnLearner::beginRound(const Model& meta, bool first) {
  if (first) resetTargets(meta.floats().data());
}

UpdateStats DqnLearner::learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) {
  const float* values = parameters.floats().data();
  UpdateStats stats;
  const std::int64_t broken_before = rollout_.broken().count();
  stats.env_steps = collect(values, rng);
  stats.broken_episodes = rollout_.broken().count() - broken_before;
  stats.loss = update(values, *std::get<Optimizer<float>*>(optimizer), rng);
  stats.updates = 1;
  losses_.front().value = stats.loss;
  return stats;
}

std::vector<std::string> DqnLearner::envNames() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < rollout_.size(); ++i) names.push_back("env_" + std::to_string(i));
  return names;
}

void DqnLearner::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  update_.saveState(writer);
  writer.part("replay", replay_);
  writer.part("n_step", n_step_);
  if (started_) rollout_.saveEpisodes(writer, "observations", envNames());
}

void DqnLearner::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  update_.loadState(reader);
  reader.part("replay", replay_);
  reader.part("n_step", n_step_);
  // actions become indices
  for (std::size_t slot = 0; slot < replay_.size(); ++slot) {
    if (!isAction(*replay_.buffer()[slot].action)) reader.refuse("replay", "holds no action");
  }
  for (const NStepAccumulator::Queue& queue : n_step_.queues()) {
    for (const float action : queue.actions) {
      if (!isAction(action)) reader.refuse("n_step", "holds no action");
    }
  }
  if (!started_) return;
  if (replay_.size() == 0) reader.refuse("replay", "is empty after the warm-up");
  rollout_.loadEpisodes(reader, "observations", envNames());
}

bool DqnLearner::isAction(float action) const {
  return action >= 0 && action < static_cast<float>(network().outputs()) &&
         action == std::floor(action);
}

}  // namespace pmeta
