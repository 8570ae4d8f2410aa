#include "pmeta_core/baselines/metacure_collector.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pmeta {

MetaCureCollector::MetaCureCollector(std::unique_ptr<Env> env, const MetaCureNetworks& networks,
                                     const float* parameters, const MetaCureSettings& settings,
                                     std::size_t buffer_size)
    : gamma_(static_cast<float>(settings.sac.gamma)),
      trial_episodes_(settings.trial_episodes),
      prior_steps_(settings.prior_steps),
      posterior_steps_(settings.posterior_steps),
      rollout_(makeEnvs([&](int) { return std::move(env); }, 1), Rollout::AtEnd::kStop,
               BrokenEpisodes::kForgiven),
      replay_(buffer_size, rollout_.env(0).spec().observation_size,
              rollout_.env(0).spec().action_size),
      trials_(static_cast<std::size_t>(settings.trial_buffer),
              static_cast<std::size_t>(settings.trial_episodes * rollout_.env(0).spec().horizon),
              networks.encoder().observationSize(), networks.encoder().actionSize()),
      explorer_(networks, parameters, GaussianActor::By::kSample),
      exploiter_(networks.exploiter().actor(), std::vector<float>(networks.encoder().latentSize()),
                 1, GaussianActor::By::kSample, parameters, networks.exploiter().minLogStd()),
      action_(networks.encoder().actionSize()) {}

std::int64_t MetaCureCollector::warmUp(std::int64_t steps, Rng& rng) {
  std::int64_t made = 0;
  while (made < steps || trials_.size() == 0) made += trial(rng);
  return made;
}

std::int64_t MetaCureCollector::visit(Rng& rng) {
  std::int64_t made = trial(rng);
  belief_ = explorer_.belief();
  made += exploit(Acting::kOnPrior, prior_steps_, rng);
  return made + exploit(Acting::kOnPosterior, posterior_steps_, rng);
}

std::int64_t MetaCureCollector::trial(Rng& rng) {
  acting_ = Acting::kExplorer;
  explorer_.forget();
  std::int64_t made = 0;
  for (int episode = 0; episode < trial_episodes_; ++episode) made += runEpisode(rng);
  trials_.endTrial();
  return made;
}

std::int64_t MetaCureCollector::exploit(Acting acting, std::int64_t steps, Rng& rng) {
  acting_ = acting;
  std::int64_t made = 0;
  while (made < steps) made += runEpisode(rng);
  return made;
}

std::int64_t MetaCureCollector::runEpisode(Rng& rng) {
  std::int64_t made = 0;
  for (rollout_.begin(1, *this, rng); rollout_.running();) made += rollout_.step(*this, rng);
  return made;
}

Actor& MetaCureCollector::actor() {
  if (acting_ == Acting::kExplorer) return explorer_;
  return exploiter_;
}

void MetaCureCollector::begin(std::size_t, Rng& rng) {
  if (acting_ == Acting::kExplorer) return;
  std::vector<float>& z = exploiter_.taskInput();
  for (std::size_t i = 0; i < z.size(); ++i) {
    z[i] = static_cast<float>(rng.normal());
    if (acting_ == Acting::kOnPosterior)
      z[i] = belief_[i] + std::sqrt(belief_[z.size() + i]) * z[i];
  }
}

void MetaCureCollector::look(const float* observations, const std::vector<std::size_t>& envs) {
  actor().look(observations, envs);
}

bool MetaCureCollector::act(std::size_t row, Rng& rng, double* action) {
  return actor().act(row, rng, action);
}

void MetaCureCollector::observe(const Experience& e) {
  std::copy_n(e.action, action_.size(), action_.begin());
  const auto reward = static_cast<float>(e.step.reward);
  replay_.add({e.observation, action_.data(), reward, e.step.terminated ? 0.0f : gamma_,
               e.next_observation});
  if (acting_ != Acting::kExplorer) return;
  trials_.add({e.observation, action_.data(), reward, static_cast<float>(e.step.evaluatedReward()),
               e.next_observation});
  explorer_.observe(e);
}

void MetaCureCollector::saveState(StateWriter& writer) const {
  writer.part("broken", rollout_.broken());
  writer.part("replay", replay_);
  writer.part("trials", trials_);
}

void MetaCureCollector::loadState(StateReader& reader) {
  reader.part("broken", rollout_.broken());
  reader.part("replay", replay_);
  reader.part("trials", trials_);
}

}  // namespace pmeta
