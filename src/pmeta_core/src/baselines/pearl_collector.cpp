#include "pmeta_core/baselines/pearl_collector.h"

#include <algorithm>
#include <utility>

namespace pmeta {
PearlCollector::PearlCollector(std::unique_ptr<Env> env, const SacNetworks& networks,
                               const SacSettings& settings, std::size_t buffer_size)
    : networks_(networks),
      gamma_(static_cast<float>(settings.gamma)),
      posterior_is_context_(settings.context.posterior_episodes),
      rollout_(makeEnvs([&](int) { return std::move(env); }, 1), Rollout::AtEnd::kStop,
               BrokenEpisodes::kForgiven),
      replay_(buffer_size, static_cast<int>(networks.observationSize()),
              static_cast<int>(networks.actionSize())),
      context_(networks.encoder(), settings.context, static_cast<int>(networks.observationSize()),
               static_cast<int>(networks.actionSize())),
      task_(networks.encoder(), settings.context),
      acting_(networks.actor(), std::vector<float>(networks.taskInputSize()), 1,
              GaussianActor::By::kSample, nullptr, networks.minLogStd()),
      action_(networks.actionSize()) {}

std::int64_t PearlCollector::explore(const float* parameters, std::int64_t steps, Rng& rng) {
  parameters_ = parameters;
  on_prior_ = true;
  return runEpisodes(steps, rng);
}

std::int64_t PearlCollector::visit(const float* parameters, std::int64_t prior_steps,
                                   std::int64_t posterior_steps, Rng& rng) {
  context_.clear();
  const std::int64_t explored = explore(parameters, prior_steps, rng);
  on_prior_ = false;
  return explored + runEpisodes(posterior_steps, rng);
}

std::int64_t PearlCollector::runEpisodes(std::int64_t steps, Rng& rng) {
  acting_.use(parameters_);
  std::int64_t made = 0;
  while (made < steps) {
    for (rollout_.begin(1, *this, rng); rollout_.running();) made += rollout_.step(*this, rng);
  }
  return made;
}

void PearlCollector::begin(std::size_t, Rng& rng) {
  if (on_prior_) {
    for (float& z : acting_.taskInput()) z = static_cast<float>(rng.normal());
    return;
  }
  context_.draw(parameters_ + networks_.encoderOffset(), rng, task_);
  std::copy(task_.z.begin(), task_.z.end(), acting_.taskInput().begin());
}

void PearlCollector::look(const float* observations, const std::vector<std::size_t>& envs) {
  acting_.look(observations, envs);
}

bool PearlCollector::act(std::size_t row, Rng& rng, double* action) {
  return acting_.act(row, rng, action);
}

void PearlCollector::observe(const Experience& e) {
  std::copy_n(e.action, action_.size(), action_.begin());
  Transition transition{e.observation, action_.data(), static_cast<float>(e.step.reward),
                        e.step.terminated ? 0.0f : gamma_, e.next_observation};
  replay_.add(transition);
  if (!on_prior_ && !posterior_is_context_) return;
  transition.reward = static_cast<float>(e.step.evaluatedReward());
  context_.add(transition);
}

void PearlCollector::saveState(StateWriter& writer) const {
  writer.part("broken", rollout_.broken());
  writer.part("replay", replay_);
  writer.part("context", context_);
}

void PearlCollector::loadState(StateReader& reader) {
  reader.part("broken", rollout_.broken());
  reader.part("replay", replay_);
  reader.part("context", context_);
}

}  // namespace pmeta
