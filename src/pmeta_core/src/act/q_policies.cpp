#include "pmeta_core/act/q_policies.h"

#include "pmeta_core/act/greedy_action.h"

namespace pmeta {

QActor::QActor(const Mlp& network, std::size_t max_batch, const float* parameters)
    : network_(network), workspace_(network, max_batch), parameters_(parameters) {}

void QActor::look(const float* observations, const std::vector<std::size_t>& envs) {
  values_ = network_.forward(parameters_, observations, envs.size(), workspace_);
}

bool QActor::act(std::size_t row, Rng&, double* action) {
  const std::size_t n = network_.outputs();
  *action = greedyAction(values_ + row * n, static_cast<int>(n));
  return true;
}

QPolicies::QPolicies(const MlpSpec& network)
    : PolicyFamily(ModelLayout(Precision::kFloat32, Mlp(network).blocks())), network_(network) {}

void QPolicies::initialise(Model& parameters, Rng& rng) const {
  network_.initialise(parameters.floats().data(), rng);
}

std::unique_ptr<Actor> QPolicies::actor(const Model& parameters, std::vector<float>,
                                        std::size_t max_batch) const {
  return std::make_unique<QActor>(network_, max_batch, parameters.floats().data());
}

}  // namespace pmeta
