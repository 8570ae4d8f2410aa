#include "pmeta_core/adapt/latent_adaptation.h"

#include <algorithm>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

const ContextEncoder& requireEncoder(const SacNetworks& networks) {
  if (!networks.hasEncoder()) {
    throw Error("adapting to a task needs the context encoder: set task_encoding to inference.");
  }
  return networks.encoder();
}

}  // namespace

LatentAdaptation::LatentAdaptation(const SacNetworks& networks, const ContextSettings& settings,
                                   const float* parameters)
    : networks_(networks),
      parameters_(parameters),
      encoder_(requireEncoder(networks)),
      on_prior_(settings.exploration_prior),
      workspace_(encoder_, static_cast<std::size_t>(settings.batch_size)),
      acting_(networks.actor(), std::vector<float>(encoder_.latentSize()), 1,
              settings.exploration_noise ? GaussianActor::By::kSample : GaussianActor::By::kMean,
              parameters, networks.minLogStd()),
      noise_(encoder_.latentSize()),
      action_(networks.actionSize()) {
  episodeOver();
}

void LatentAdaptation::beginEpisode(Rng& rng) {
  if (!on_prior_) {
    drawLatent(posterior_, rng, noise_.data(), acting_.taskInput().data());
    return;
  }
  for (float& z : acting_.taskInput()) z = static_cast<float>(rng.normal());
}

void LatentAdaptation::look(const float* observations, const std::vector<std::size_t>& envs) {
  acting_.look(observations, envs);
}

bool LatentAdaptation::act(std::size_t row, Rng& rng, double* action) {
  return acting_.act(row, rng, action);
}

void LatentAdaptation::observe(const Experience& e) {
  std::copy_n(e.action, action_.size(), action_.begin());
  context_.resize(context_.size() + encoder_.rowSize());
  encoder_.writeRow({e.observation, action_.data(), static_cast<float>(e.step.evaluatedReward()), 0,
                     e.next_observation},
                    &context_[context_.size() - encoder_.rowSize()]);
}

void LatentAdaptation::episodeOver() {
  encoder_.infer(parameters_ + networks_.encoderOffset(), context_.data(),
                 context_.size() / encoder_.rowSize(), workspace_, posterior_);
}

std::unique_ptr<Actor> LatentAdaptation::adapted(std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.actor(), taskInput(), max_batch,
                                         GaussianActor::By::kMean, parameters_);
}

std::vector<float> LatentAdaptation::taskInput() const {
  return {posterior_.mean.begin(), posterior_.mean.end()};
}

}  // namespace pmeta
