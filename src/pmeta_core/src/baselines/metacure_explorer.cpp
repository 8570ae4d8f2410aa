#include "pmeta_core/baselines/metacure_explorer.h"

#include <algorithm>

namespace pmeta {

MetaCureExplorer::MetaCureExplorer(const MetaCureNetworks& networks, const float* parameters,
                                   GaussianActor::By by)
    : networks_(networks),
      parameters_(parameters),
      acting_(networks.explorer().actor(), std::vector<float>(networks.encoder().beliefSize()), 1,
              by, parameters + networks.explorerOffset(), networks.explorer().minLogStd()),
      workspace_(networks.encoder()),
      hidden_(networks.encoder().units()),
      next_hidden_(hidden_),
      token_(networks.encoder().tokenSize()) {}

void MetaCureExplorer::forget() {
  std::fill(hidden_.begin(), hidden_.end(), 0.0f);
  std::fill(token_.begin(), token_.end(), 0.0f);
  begun_ = false;
}

// what the last step led to is looked at, but not yet part of the history: another episode may
// begin elsewhere
std::vector<float> MetaCureExplorer::belief() const {
  const BeliefEncoder& encoder = networks_.encoder();
  std::vector<float> belief(encoder.beliefSize());
  if (begun_) {
    std::vector<float> hidden = hidden_;
    encoder.step(parameters_ + networks_.encoderOffset(), token_.data(), hidden.data(),
                 belief.data(), workspace_);
  } else {
    std::fill_n(&belief[encoder.latentSize()], encoder.latentSize(), 1.0f);
  }
  return belief;
}

void MetaCureExplorer::look(const float* observations, const std::vector<std::size_t>& envs) {
  const BeliefEncoder& encoder = networks_.encoder();
  std::copy_n(observations, encoder.observationSize(), token_.begin());
  next_hidden_ = hidden_;
  encoder.step(parameters_ + networks_.encoderOffset(), token_.data(), next_hidden_.data(),
               acting_.taskInput().data(), workspace_);
  acting_.look(observations, envs);
}

bool MetaCureExplorer::act(std::size_t row, Rng& rng, double* action) {
  return acting_.act(row, rng, action);
}

void MetaCureExplorer::observe(const Experience& e) {
  const BeliefEncoder& encoder = networks_.encoder();
  hidden_ = next_hidden_;
  float* token = std::copy_n(e.next_observation, encoder.observationSize(), token_.data());
  token = std::copy_n(e.action, encoder.actionSize(), token);
  *token = static_cast<float>(e.step.evaluatedReward());
  begun_ = true;
}

MetaCureAdaptation::MetaCureAdaptation(const MetaCureNetworks& networks, const float* parameters)
    : networks_(networks),
      parameters_(parameters),
      explorer_(networks, parameters, GaussianActor::By::kMean) {}

std::unique_ptr<Actor> MetaCureAdaptation::adapted(std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.exploiter().actor(), taskInput(), max_batch,
                                         GaussianActor::By::kMean, parameters_);
}

std::vector<float> MetaCureAdaptation::taskInput() const {
  std::vector<float> belief = explorer_.belief();
  belief.resize(networks_.encoder().latentSize());
  return belief;
}

}  // namespace pmeta
