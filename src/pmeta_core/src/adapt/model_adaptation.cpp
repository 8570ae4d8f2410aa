#include "pmeta_core/adapt/model_adaptation.h"

#include <algorithm>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

const TaskModel& requireModel(const SacNetworks& networks) {
  if (!networks.hasTaskModel()) {
    throw Error("finding out the task by a model needs one: set task_encoding to model.");
  }
  return networks.taskModel();
}

}  // namespace

ModelAdaptation::ModelAdaptation(const SacNetworks& networks, const SacSettings& settings,
                                 const float* parameters)
    : networks_(networks),
      parameters_(parameters),
      posterior_(requireModel(networks), settings.task_model,
                 parameters + networks.taskModelOffset()),
      acting_(networks.actor(), std::vector<float>(networks.taskInputSize()), 1,
              settings.context.exploration_noise ? GaussianActor::By::kSample
                                                 : GaussianActor::By::kMean,
              parameters, networks.minLogStd()),
      observation_(networks.observationSize()),
      action_(networks.actionSize()) {}

void ModelAdaptation::guess(Rng& rng) {
  guess_ = posterior_.draw(rng);
  acting_.taskInput() = oneHot(static_cast<int>(guess_), static_cast<int>(posterior_.tasks()));
}

bool ModelAdaptation::refuted() const {
  const std::vector<double>& weights = posterior_.weights();
  return weights[guess_] < *std::max_element(weights.begin(), weights.end()) / 2;
}

void ModelAdaptation::look(const float* observations, const std::vector<std::size_t>&) {
  std::copy_n(observations, observation_.size(), observation_.begin());
}

bool ModelAdaptation::act(std::size_t row, Rng& rng, double* action) {
  if (refuted()) guess(rng);
  acting_.look(observation_.data(), {row});
  return acting_.act(row, rng, action);
}

void ModelAdaptation::observe(const Experience& e) {
  std::copy_n(e.action, action_.size(), action_.begin());
  posterior_.observe({e.observation, action_.data(), static_cast<float>(e.step.evaluatedReward()),
                      0, e.next_observation});
}

std::unique_ptr<Actor> ModelAdaptation::adapted(std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.actor(), taskInput(), max_batch,
                                         GaussianActor::By::kMean, parameters_);
}

}  // namespace pmeta
