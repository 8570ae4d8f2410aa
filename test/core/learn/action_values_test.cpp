#include "pmeta_core/learn/action_values.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

SacNetworks networksOf(int action_size) {
  EnvSpec spec;
  spec.name = "plane";
  spec.observation_size = 3;
  spec.action_size = action_size;
  SacSettings settings;
  settings.hidden = {7, 5};
  settings.task_encoding = "one_hot";
  return SacNetworks(spec, settings, 2);
}

TEST(ActionValues, AreTheSmallerCriticsOnEveryActionOfTheGrid) {
  const SacNetworks networks = networksOf(2);
  AlignedFloats parameters(networks.size());
  Rng rng(3, 0, Stream::kInitialise);
  networks.initialise(parameters.data(), rng);
  const float observation[] = {0.3f, -1.2f, 2};
  const float task_input[] = {0, 1};
  const int size = 5;
  const std::vector<float> values =
      actionValues(networks, parameters.data(), observation, task_input, size);
  ASSERT_EQ(values.size(), 25u);

  MlpWorkspace workspace(networks.critic(0), 1);
  const double axis[] = {-1, -0.5, 0, 0.5, 1};
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const float input[] = {0.3f, -1.2f, 2, 0, 1, float(axis[j]), float(axis[i])};
      float q[2];
      for (int k = 0; k < 2; ++k) {
        q[k] = *networks.critic(k).forward(parameters.data() + networks.criticOffset(k), input, 1,
                                           workspace);
      }
      EXPECT_NEAR(values[i * size + j], std::min(q[0], q[1]), 1e-6) << i << " " << j;
    }
  }
  EXPECT_GT(*std::max_element(values.begin(), values.end()),
            *std::min_element(values.begin(), values.end()) + 1e-3);
}

TEST(ActionValues, NeedTwoDimensions) {
  const SacNetworks networks = networksOf(1);
  const AlignedFloats parameters(networks.size());
  const float inputs[] = {0, 0, 0};
  EXPECT_EQ(errorOf([&] { actionValues(networks, parameters.data(), inputs, inputs, 5); }),
            "a grid of action values needs actions of two dimensions; these have 1.");
}

}  // namespace
}  // namespace pmeta
