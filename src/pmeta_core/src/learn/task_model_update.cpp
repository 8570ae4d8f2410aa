#include "pmeta_core/learn/task_model_update.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pmeta {

TaskModelUpdate::TaskModelUpdate(const TaskModel& model, std::size_t batch,
                                 const std::vector<float>& z)
    : model_(model),
      batch_(batch),
      workspace_(model.network(), batch),
      input_(batch * model.network().inputs()),
      outcomes_(batch * model.outputs()),
      d_outputs_(outcomes_),
      losses_(model.outputs()),
      gradient_(model.size()) {
  for (std::size_t b = 0; b < batch; ++b) {
    std::copy(z.begin(), z.end(), &input_[b * model.network().inputs() + model.rowSize()]);
  }
}

double TaskModelUpdate::apply(const float* parameters, const ReplayBuffer& kept, std::size_t offset,
                              Optimizer<float>& optimizer, Rng& rng) {
  const Mlp& network = model_.network();
  const std::size_t outputs = model_.outputs();
  for (std::size_t b = 0; b < batch_; ++b) {
    model_.write(kept[rng.below(kept.size())], &input_[b * network.inputs()],
                 &outcomes_[b * outputs]);
  }
  const float* predicted = network.forward(parameters, input_.data(), batch_, workspace_);
  std::fill(losses_.begin(), losses_.end(), 0.0);
  const auto n = static_cast<float>(batch_);
  for (std::size_t i = 0; i < outcomes_.size(); ++i) {
    const float error = predicted[i] - outcomes_[i];
    losses_[i % outputs] += static_cast<double>(error) * error / n;
    d_outputs_[i] = 2 * error / n;
  }
  network.backward(parameters, input_.data(), batch_, d_outputs_.data(), gradient_.data(), nullptr,
                   workspace_);
  for (std::size_t k = 0; k < outputs; ++k) {
    const double variance = std::exp(static_cast<double>(parameters[network.size() + k]));
    gradient_[network.size() + k] = static_cast<float>((1 - losses_[k] / variance) / 2);
  }
  optimizer.apply(offset, gradient_.data(), gradient_.size());
  return std::accumulate(losses_.begin(), losses_.end(), 0.0);
}

}  // namespace pmeta
