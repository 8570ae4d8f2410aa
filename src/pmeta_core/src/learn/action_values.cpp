#include "pmeta_core/learn/action_values.h"

#include <algorithm>
#include <string>

#include "pmeta_core/base/error.h"

namespace pmeta {

std::vector<float> actionValues(const SacNetworks& networks, const float* parameters,
                                const float* observation, const float* task_input, int size) {
  if (networks.actionSize() != 2) {
    throw Error("a grid of action values needs actions of two dimensions; these have " +
                std::to_string(networks.actionSize()) + ".");
  }
  if (size < 2) throw Error("a grid of action values needs at least two actions along an axis.");
  const auto n = static_cast<std::size_t>(size);
  const auto along = [size](std::size_t i) { return -1 + 2 * static_cast<float>(i) / (size - 1); };
  AlignedFloats input(n * networks.critic(0).inputs());
  MlpWorkspace workspaces[] = {{networks.critic(0), n}, {networks.critic(1), n}};
  std::vector<float> values(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    float* row = input.data();
    for (std::size_t j = 0; j < n; ++j) {
      row = std::copy_n(observation, networks.observationSize(), row);
      row = std::copy_n(task_input, networks.taskInputSize(), row);
      *row++ = along(j);
      *row++ = along(i);
    }
    const float* q[2];
    for (int k = 0; k < 2; ++k) {
      q[k] = networks.critic(k).forward(parameters + networks.criticOffset(k), input.data(), n,
                                        workspaces[k]);
    }
    for (std::size_t j = 0; j < n; ++j) values[i * n + j] = std::min(q[0][j], q[1][j]);
  }
  return values;
}

}  // namespace pmeta
