#include "pmeta_core/baselines/information_gain.h"

#include "pmeta_core/baselines/plain_adam.h"

#include <algorithm>
#include <string>
#include <utility>

namespace pmeta {
namespace {

MlpSpec predictor(const char* prefix, const EnvSpec& env, int task_inputs,
                  const MetaCureSettings& settings) {
  const int inputs = task_inputs + env.observation_size + env.action_size;
  const int outputs = 1 + (settings.predicts_next ? env.observation_size : 0);
  return mlpSpec(prefix, static_cast<std::size_t>(inputs), settings.sac.hidden,
                 static_cast<std::size_t>(outputs), settings.sac.portable);
}

std::size_t batchOf(const MetaCureSettings& settings) {
  return static_cast<std::size_t>(settings.meta_batch * settings.task_batch);
}

}  // namespace

InformationGain::Predictor::Predictor(MlpSpec spec, std::size_t batch, double learning_rate)
    : network(std::move(spec)),
      rows(batch),
      parameters(network.size()),
      gradient(network.size()),
      inputs(batch * network.inputs()),
      d_outputs(batch * network.outputs()),
      work(network, batch),
      adam(parameters.data(), nullptr, parameters.size(), plainAdam(learning_rate)) {}

// mean over the rows of predictionError(), before the step
double InformationGain::Predictor::learn(const AlignedFloats& seen) {
  const std::size_t outputs = network.outputs();
  const float* predicted = predict();
  double loss = 0;
  for (std::size_t r = 0; r < rows; ++r) {
    loss += predictionError(predicted + r * outputs, &seen[r * outputs], outputs);
  }
  const auto n = static_cast<float>(rows), others = static_cast<float>(outputs - 1);
  for (std::size_t i = 0; i < d_outputs.size(); ++i) {
    d_outputs[i] = 2 * (predicted[i] - seen[i]) / (i % outputs == 0 ? n : n * others);
  }
  network.backward(parameters.data(), inputs.data(), rows, d_outputs.data(), gradient.data(),
                   nullptr, work);
  adam.beginUpdate();
  adam.apply(0, gradient.data(), gradient.size());
  return loss / static_cast<double>(rows);
}

InformationGain::InformationGain(const EnvSpec& env, int num_tasks,
                                 const MetaCureSettings& settings)
    : outputs_(static_cast<std::size_t>(1 + (settings.predicts_next ? env.observation_size : 0))),
      belief_size_(2 * static_cast<std::size_t>(settings.latent_size)),
      num_tasks_(static_cast<std::size_t>(num_tasks)),
      observation_size_(static_cast<std::size_t>(env.observation_size)),
      action_size_(static_cast<std::size_t>(env.action_size)),
      by_belief_(predictor("by_belief", env, 2 * settings.latent_size, settings), batchOf(settings),
                 settings.learning_rate),
      by_task_(predictor("by_task", env, num_tasks, settings), batchOf(settings),
               settings.learning_rate),
      seen_(batchOf(settings) * outputs_),
      gains_(batchOf(settings)) {}

void InformationGain::initialise(Rng& rng) {
  for (Predictor* predictor : {&by_belief_, &by_task_}) {
    predictor->network.initialise(predictor->parameters.data(), rng);
  }
}

void InformationGain::put(std::size_t row, const Transition& step, const float* belief,
                          std::size_t task) {
  const auto write = [&](float* input) {
    input = std::copy_n(step.observation, observation_size_, input);
    std::copy_n(step.action, action_size_, input);
  };
  float* input = &by_belief_.inputs[row * by_belief_.network.inputs()];
  write(std::copy_n(belief, belief_size_, input));
  input = &by_task_.inputs[row * by_task_.network.inputs()];
  std::fill_n(input, num_tasks_, 0.0f);
  input[task] = 1;
  write(input + num_tasks_);
  float* seen = &seen_[row * outputs_];
  *seen = step.reward;
  std::copy_n(step.next_observation, outputs_ - 1, seen + 1);
}

InformationGain::Losses InformationGain::learn() {
  return {by_belief_.learn(seen_), by_task_.learn(seen_)};
}

const std::vector<float>& InformationGain::gains() {
  const float *by_belief = by_belief_.predict(), *by_task = by_task_.predict();
  for (std::size_t r = 0; r < gains_.size(); ++r) {
    const std::size_t at = r * outputs_;
    gains_[r] = static_cast<float>(predictionError(by_belief + at, &seen_[at], outputs_) -
                                   predictionError(by_task + at, &seen_[at], outputs_));
  }
  return gains_;
}

void InformationGain::saveState(StateWriter& writer) const {
  writer.array("by_belief", by_belief_.parameters);
  writer.part("by_belief_adam", by_belief_.adam);
  writer.array("by_task", by_task_.parameters);
  writer.part("by_task_adam", by_task_.adam);
}

void InformationGain::loadState(StateReader& reader) {
  reader.array("by_belief", by_belief_.parameters);
  reader.part("by_belief_adam", by_belief_.adam);
  reader.array("by_task", by_task_.parameters);
  reader.part("by_task_adam", by_task_.adam);
}

}  // namespace pmeta
