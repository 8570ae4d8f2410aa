#include "pmeta_core/baselines/on_policy_sampler.h"

#include <cmath>
#include <utility>

namespace pmeta {
namespace {

void append(std::vector<double>& to, const std::vector<double>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

}  // namespace

RecordingActor::RecordingActor(const GaussianMlp& policy, double scale,
                               std::vector<double> parameters, std::size_t max_batch)
    : GaussianMlpActor(policy, scale, std::move(parameters), max_batch),
      recorded_(max_batch),
      mean_(policy.actions()),
      u_(policy.actions()) {
  for (const double log_std : policy.logStd(this->parameters().data())) {
    std_.push_back(std::exp(log_std));
  }
}

void RecordingActor::begin(std::size_t env, Rng&) { recorded_[env].emplace_back(); }

void RecordingActor::look(const float* observations, const std::vector<std::size_t>& envs) {
  envs_ = envs;
  GaussianMlpActor::look(observations, envs);
}

bool RecordingActor::act(std::size_t row, Rng& rng, double* action) {
  acting_in_ = envs_[row];
  return GaussianMlpActor::act(row, rng, action);
}

void RecordingActor::draw(const double* mean, Rng& rng, double* u) {
  for (std::size_t j = 0; j < u_.size(); ++j) {
    mean_[j] = mean[j];
    u[j] = u_[j] = mean[j] + std_[j] * rng.normal();
  }
}

void RecordingActor::observe(const Experience& e) {
  Recorded& episode = recorded_[acting_in_].back();
  const std::size_t size = policy().inputs();
  episode.path.observations.insert(episode.path.observations.end(), e.observation,
                                   e.observation + size);
  episode.path.rewards.push_back(e.step.reward);
  episode.path.last_observation.assign(e.next_observation, e.next_observation + size);
  episode.path.terminated = e.step.terminated;
  append(episode.actions, u_);
  append(episode.means, mean_);
}

std::vector<const RecordingActor::Recorded*> RecordingActor::episodes() const {
  std::vector<const Recorded*> episodes;
  for (const auto& of_env : recorded_) {
    for (const Recorded& episode : of_env) {
      if (episode.path.steps() > 0) episodes.push_back(&episode);
    }
  }
  return episodes;
}

std::size_t RecordingActor::steps() const {
  std::size_t steps = 0;
  for (const Recorded* episode : episodes()) steps += episode->path.steps();
  return steps;
}

std::vector<Path> RecordingActor::paths() const {
  std::vector<Path> paths;
  for (const Recorded* episode : episodes()) paths.push_back(episode->path);
  return paths;
}

ActionData RecordingActor::data(const AdvantageSettings& settings) const {
  ActionData data;
  for (const Recorded* episode : episodes()) {
    append(data.observations, episode->path.observations);
    append(data.actions, episode->actions);
    append(data.old_mean, episode->means);
  }
  data.rows = steps();
  const std::vector<Path> paths = this->paths();
  LinearBaseline baseline;
  baseline.fit(paths, settings.gamma);
  data.advantages = advantages(paths, baseline, settings);
  normalise(data.advantages);
  data.old_log_std = policy().logStd(parameters().data());
  const std::size_t n = policy().actions();
  for (std::size_t t = 0; t < data.rows; ++t) {
    data.old_log_prob.push_back(
        logProbability(&data.actions[t * n], &data.old_mean[t * n], data.old_log_std));
  }
  return data;
}

OnPolicySampler::OnPolicySampler(std::vector<std::unique_ptr<Env>> envs)
    : rollout_(std::move(envs), Rollout::AtEnd::kStop, BrokenEpisodes::kForgiven) {}

ActionData OnPolicySampler::sample(const GaussianMlp& policy, double scale,
                                   const std::vector<double>& parameters,
                                   const AdvantageSettings& settings, Rng& rng) {
  RecordingActor actor(policy, scale, parameters, rollout_.size());
  for (rollout_.begin(rollout_.size(), actor, rng); rollout_.running();) rollout_.step(actor, rng);
  if (actor.steps() == 0) {
    throw BrokenEpisode("every episode of " + rollout_.env(0).spec().name + " at its first step");
  }
  mean_return_ = 0;
  for (std::size_t i = 0; i < rollout_.size(); ++i) {
    mean_return_ += rollout_.returned(i) / static_cast<double>(rollout_.size());
  }
  return actor.data(settings);
}

}  // namespace pmeta
