#include "pmeta_core/learn/dqn_update.h"

#include <algorithm>

#include "pmeta_core/act/greedy_action.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {

DqnUpdate::DqnUpdate(const Mlp& network, const DqnSettings& settings)
    : network_(network),
      settings_(settings),
      num_actions_(static_cast<int>(network.outputs())),
      workspace_(network, static_cast<std::size_t>(settings.batch_size)),
      targets_(static_cast<std::size_t>(settings.averaged_targets) * network.size()),
      target_values_(static_cast<std::size_t>(settings.batch_size * num_actions_)),
      td_targets_(static_cast<std::size_t>(settings.batch_size)),
      td_errors_(static_cast<std::size_t>(settings.batch_size)),
      sample_gradient_(static_cast<std::size_t>(settings.batch_size)),
      output_gradient_(static_cast<std::size_t>(settings.batch_size * num_actions_)),
      gradient_(network.size()) {}

void DqnUpdate::resetTargets(const float* parameters) {
  for (int k = 0; k < settings_.averaged_targets; ++k) {
    std::copy_n(parameters, network_.size(), target(k));
  }
}

double DqnUpdate::apply(const float* parameters, const ReplayBatch& batch,
                        Optimizer<float>& optimizer) {
  computeTargets(parameters, batch);
  // last of the forward passes: the workspace then holds what the backward pass needs
  const float* q_values =
      network_.forward(parameters, batch.observations.data(), settings_.batch_size, workspace_);
  const double loss = computeOutputGradient(q_values, batch);
  network_.backward(parameters, batch.observations.data(), settings_.batch_size,
                    output_gradient_.data(), gradient_.data(), nullptr, workspace_);
  optimizer.apply(0, gradient_.data(), gradient_.size());

  ++updates_;
  if (updates_ % settings_.target_update_interval == 0) {
    newest_target_ = (newest_target_ + 1) % settings_.averaged_targets;
    std::copy_n(parameters, network_.size(), target(newest_target_));
  }
  return loss;
}

void DqnUpdate::computeTargets(const float* parameters, const ReplayBatch& batch) {
  const float* next = batch.next_observations.data();
  std::fill(target_values_.begin(), target_values_.end(), 0.0f);
  const float share = 1.0f / static_cast<float>(settings_.averaged_targets);
  for (int k = 0; k < settings_.averaged_targets; ++k) {
    const float* values = network_.forward(target(k), next, settings_.batch_size, workspace_);
    for (std::size_t j = 0; j < target_values_.size(); ++j) target_values_[j] += share * values[j];
  }

  const float* chooser = target_values_.data();
  if (settings_.double_q) {
    chooser = network_.forward(parameters, next, settings_.batch_size, workspace_);
  }
  for (int b = 0; b < settings_.batch_size; ++b) {
    const int row = b * num_actions_;
    const int action = greedyAction(chooser + row, num_actions_);
    td_targets_[b] = batch.rewards[b] + batch.discounts[b] * target_values_[row + action];
  }
}

double DqnUpdate::computeOutputGradient(const float* q_values, const ReplayBatch& batch) {
  const auto entry = [&](int b) {
    return b * num_actions_ + static_cast<int>(batch.actions[static_cast<std::size_t>(b)]);
  };
  for (int b = 0; b < settings_.batch_size; ++b) {
    td_errors_[b] = q_values[entry(b)] - td_targets_[b];
  }
  const float* weights = batch.weights.data();
  const double loss = settings_.huber
                          ? kernels().huberLoss(td_errors_.data(), weights, 1.0f,
                                                sample_gradient_.data(), td_errors_.size())
                          : kernels().squaredLoss(td_errors_.data(), weights,
                                                  sample_gradient_.data(), td_errors_.size());
  std::fill(output_gradient_.begin(), output_gradient_.end(), 0.0f);
  for (int b = 0; b < settings_.batch_size; ++b) output_gradient_[entry(b)] = sample_gradient_[b];
  return loss;
}

void DqnUpdate::saveState(StateWriter& writer) const {
  writer.count("updates", updates_);
  writer.count("newest_target", newest_target_);
  writer.array("targets", targets_);
}

void DqnUpdate::loadState(StateReader& reader) {
  updates_ = reader.count("updates");
  newest_target_ =
      static_cast<int>(reader.count("newest_target", 0, settings_.averaged_targets - 1));
  reader.array("targets", targets_);
}

}  // namespace pmeta
