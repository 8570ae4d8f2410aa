// What soft actor-critic has a choice of for the methods that it is part of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pmeta_core/learn/sac.h"
#include "sac_trainer.h"

namespace pmeta {
namespace {

using test::PushedPoint;
using test::smallSettings;
using test::Trainer;

TEST(Sac, ValueNetworkMovesBeforeTheActorAndAloneHasATarget) {
  SacSettings settings = smallSettings("inference");
  settings.backbone = "value";
  Trainer trainer(settings);
  const SacNetworks& networks = trainer.learner.networks();
  EXPECT_EQ(trainer.learner.targets().size(), networks.value().size());
  trainer.update();
  const AlignedFloats targets = trainer.learner.targets();
  trainer.optimizer.offsets.clear();
  trainer.update();
  EXPECT_EQ(trainer.optimizer.offsets,
            (std::vector<std::size_t>{networks.criticOffset(0), networks.criticOffset(1),
                                      networks.encoderOffset(), networks.valueOffset(), 0}));
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const float theta = trainer.parameters[networks.valueOffset() + k];
    EXPECT_NEAR(trainer.learner.targets()[k], targets[k] + 0.05 * (theta - targets[k]), 1e-6);
  }
}

TEST(Sac, InitialisesAsRlkitOnDemand) {
  SacSettings settings = smallSettings("inference");
  settings.backbone = "value";
  settings.initialisation = "rlkit";
  const SacNetworks networks(PushedPoint().spec(), settings, 1);
  std::vector<float> parameters(networks.size());
  Rng rng(0, 0, Stream::kInitialise);
  networks.initialise(parameters.data(), rng);
  const float* at = parameters.data();
  for (const Block& block : networks.blocks()) {
    const auto [low, high] = std::minmax_element(at, at + block.size());
    const bool last = block.name.find("layer2") != std::string::npos;
    const bool bias = block.name.find("bias") != std::string::npos;
    double bound = 1 / std::sqrt(static_cast<double>(block.shape[0]));
    if (last) bound = block.name.find("actor") == 0 ? 1e-3 : 3e-3;
    if (bias && !last) {
      EXPECT_EQ(std::count(at, at + block.size(), 0.1f), static_cast<long>(block.size()));
    } else {
      EXPECT_GE(*low, -bound) << block.name;
      EXPECT_LE(*high, bound) << block.name;
      EXPECT_NE(*low, 0) << block.name;
    }
    if (!bias && block.size() > 10) {
      EXPECT_GT(*high - *low, bound) << block.name;
    }
    at += block.size();
  }
}

}  // namespace
}  // namespace pmeta
