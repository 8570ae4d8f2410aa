#include "pmeta_core/act/gaussian_actor.h"

#include <algorithm>
#include <utility>

namespace pmeta {

GaussianActor::GaussianActor(const Mlp& network, std::vector<float> task_input,
                             std::size_t max_batch, By by, const float* parameters,
                             float min_log_std)
    : network_(network),
      task_input_(std::move(task_input)),
      by_(by),
      parameters_(parameters),
      workspace_(network, max_batch),
      input_(max_batch * network.inputs()),
      policy_(network.outputs() / 2, 1, min_log_std) {}

void GaussianActor::look(const float* observations, const std::vector<std::size_t>& envs) {
  const std::size_t observation_size = network_.inputs() - task_input_.size();
  float* row = input_.data();
  for (std::size_t b = 0; b < std::min(envs.size(), workspace_.maxBatch()); ++b) {
    row = std::copy_n(observations + b * observation_size, observation_size, row);
    row = std::copy(task_input_.begin(), task_input_.end(), row);
  }
  heads_ = network_.forward(parameters_, input_.data(), envs.size(), workspace_);
}

bool GaussianActor::act(std::size_t row, Rng& rng, double* action) {
  const float* heads = heads_ + row * network_.outputs();
  const std::size_t n = network_.outputs() / 2;
  if (by_ == By::kMean) {
    meanActions(heads, 1, n, action);
  } else {
    policy_.sample(heads, 1, rng);
    std::copy_n(policy_.actions(), n, action);
  }
  return true;
}

}  // namespace pmeta
