#include "pmeta_core/learn/sac.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "../allocations.h"
#include "../memory_state.h"
#include "../support.h"
#include "goal_learners.h"
#include "pmeta_core/aggregate/mix.h"

namespace pmeta {
namespace {

using test::adamOf;
using test::Goal;
using test::kTasks;
using test::makeLearner;
using test::pulled;
using test::run;
using test::sac;
using test::smallSac;

TEST(SacPersonalLearner, LayoutNamesEveryNetwork) {
  EXPECT_EQ(makeLearner().layout().text(),
            "float32\n"
            "actor.layer0.weight 8 5\nactor.layer0.bias 8\nactor.layer1.weight 6 8\n"
            "actor.layer1.bias 6\nactor.layer2.weight 2 6\nactor.layer2.bias 2\n"
            "critic1.layer0.weight 8 6\ncritic1.layer0.bias 8\ncritic1.layer1.weight 6 8\n"
            "critic1.layer1.bias 6\ncritic1.layer2.weight 1 6\ncritic1.layer2.bias 1\n"
            "critic2.layer0.weight 8 6\ncritic2.layer0.bias 8\ncritic2.layer1.weight 6 8\n"
            "critic2.layer1.bias 6\ncritic2.layer2.weight 1 6\ncritic2.layer2.bias 1\n");
  const std::string text = makeLearner(smallSac("inference")).layout().text();
  EXPECT_NE(text.find("actor.layer0.weight 8 4\n"), std::string::npos);
  EXPECT_NE(text.find("encoder.layer0.weight 7 4\n"), std::string::npos);
  EXPECT_NE(text.find("encoder.layer2.weight 4 5\n"), std::string::npos);
}

// what a personal learner is made of, moved by hand
struct Parts {
  Parts(const SacSettings& settings, const Model& meta, std::vector<float> task_input = {})
      : learner(std::make_unique<Goal>(0), settings, std::move(task_input)),
        phi(meta.floats()),
        omega(phi),
        adam(phi.data(), omega.data(), phi.size(), adamOf(pulled())) {
    learner.resetTargets(phi.data());
  }

  // steps made and loss
  std::pair<std::int64_t, double> update(const std::vector<float>& explorer, Rng& rng) {
    const std::int64_t steps = learner.collect(phi.data(), rng, explorer.data());
    adam.beginUpdate();
    return {steps, learner.update(phi.data(), adam, rng).critic};
  }

  SacLearner learner;
  std::vector<float> phi, omega;
  ProximalAdam adam;
};

TEST(SacPersonalLearner, UpdatesAreTheLearnersByAdamWithPull) {
  auto learner = makeLearner();
  const Model meta = learner.initialModel(1);
  Parts parts(smallSac(), meta, oneHot(1, kTasks));
  learner.beginRound(meta, false);
  Rng rng(5, 0, Stream::kSample), same = rng;
  for (int r = 0; r < 30; ++r) {
    const UpdateStats stats = learner.update(rng);
    EXPECT_EQ(std::make_pair(stats.env_steps, stats.loss), parts.update(parts.phi, same));
    EXPECT_EQ(stats.updates, 1);
  }
  EXPECT_EQ(learner.personal().floats(), parts.phi);
  EXPECT_EQ(learner.auxiliary().floats(), parts.omega);
  EXPECT_NE(parts.phi, parts.omega);
  EXPECT_NE(parts.omega, meta.floats());
}

TEST(SacPersonalLearner, TheMetaPolicyExploresForContext) {
  for (const std::string explorer : {"meta", "personal"}) {
    SacSettings settings = smallSac("inference");
    settings.context.explorer = explorer;
    auto learner = makeLearner(settings);
    const Model meta = learner.initialModel(1);
    Parts parts(settings, meta);
    learner.beginRound(meta, false);
    Rng rng(5, 0, Stream::kSample), same = rng;
    for (int r = 0; r < 30; ++r) {
      learner.update(rng);
      parts.update(explorer == "meta" ? meta.floats() : parts.phi, same);
    }
    EXPECT_EQ(sac(learner).replay().values(), parts.learner.replay().values()) << explorer;
    EXPECT_EQ(learner.personal().floats(), parts.phi) << explorer;
  }
}

TEST(SacPersonalLearner, RoundResetsParametersAndNothingElse) {
  auto learner = makeLearner(smallSac("inference"));
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(learner.initialModel(1), false);
  const SacNetworks& networks = sac(learner).networks();
  EXPECT_TRUE(std::equal(
      sac(learner).targets().begin(), sac(learner).targets().end(),
      learner.personal().floats().begin() + static_cast<std::ptrdiff_t>(networks.criticOffset(0))))
      << "the first targets are the first meta-policy's critics";
  run(learner, 20, rng);
  const AlignedFloats targets = sac(learner).targets();
  const AlignedFloats first = learner.adam().firstMoment();
  const double temperature = sac(learner).temperature().value();
  const std::vector<float> replay = sac(learner).replay().values();
  const std::vector<float> context = sac(learner).context().kept().values();
  const std::vector<float> kept = learner.personal().floats();

  const Model meta = learner.initialModel(2);
  learner.beginRound(meta, true);
  EXPECT_EQ(learner.personal().floats(), kept);
  EXPECT_EQ(learner.auxiliary().floats(), meta.floats());
  learner.beginRound(meta, false);
  EXPECT_EQ(learner.personal().floats(), meta.floats());
  EXPECT_EQ(sac(learner).targets(), targets);
  EXPECT_EQ(learner.adam().firstMoment(), first);
  EXPECT_EQ(test::stateOf(learner.adam()).get<std::int64_t>("updates").at(0), 20);
  EXPECT_EQ(sac(learner).temperature().value(), temperature);
  EXPECT_EQ(sac(learner).replay().values(), replay);
  EXPECT_EQ(sac(learner).context().kept().values(), context);
}

TEST(SacPersonalLearner, TargetsAndMomentsBeginAnewWhereSettingsSaySo) {
  SacSettings settings = smallSac();
  settings.targets_at_round = "meta";
  settings.reset_moments = true;
  auto learner = makeLearner(settings);
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(learner.initialModel(1), false);
  run(learner, 20, rng);
  const Model meta = learner.initialModel(2);
  learner.beginRound(meta, true);
  const std::size_t offset = sac(learner).networks().criticOffset(0);
  for (std::size_t k = 0; k < sac(learner).targets().size(); ++k) {
    ASSERT_EQ(sac(learner).targets()[k], meta.floats()[offset + k]);
  }
  EXPECT_EQ(test::stateOf(learner.adam()).get<std::int64_t>("updates").at(0), 0);
  EXPECT_EQ(learner.adam().firstMoment(), AlignedFloats(meta.size()));
}

TEST(SacPersonalLearner, OwnColumnIsAggregatedFromItsTaskAlone) {
  std::vector<Model> sent;
  Model meta;
  for (int task = 0; task < kTasks; ++task) {
    auto learner = makeLearner(smallSac(), task);
    meta = learner.initialModel(1);
    learner.beginRound(meta, false);
    Rng rng(1, static_cast<std::uint64_t>(task), Stream::kSample);
    run(learner, 20, rng);
    sent.push_back(learner.personal());
    EXPECT_EQ(learner.auxiliary().present, sent.back().present);
  }
  const Model before = meta;
  std::vector<Contribution> contributions;
  for (const Model& model : sent) contributions.push_back({&model, 1.0});
  mixInto(meta, contributions, 1);

  // owner of each parameter, from the blocks' names and shapes
  std::size_t k = 0, owned = 0;
  for (const Block& block : meta.layout.blocks()) {
    const bool first_layer = block.name.find("layer0.weight") != std::string::npos;
    for (std::size_t j = 0; j < block.size(); ++j, ++k) {
      const std::size_t column = first_layer ? j % block.shape[1] : 0;
      const bool one_hot = first_layer && column >= 2 && column < 2 + kTasks;
      double expected = 0;
      for (std::size_t task = 0; task < kTasks; ++task) {
        EXPECT_EQ(sent[task].isPresent(k), !one_hot || column == 2 + task);
        expected += sent[task].floats()[k] / kTasks;
      }
      if (one_hot) {
        expected = sent[column - 2].floats()[k];
        for (std::size_t task = 0; task < kTasks; ++task) {
          if (task != column - 2) {
            EXPECT_EQ(sent[task].floats()[k], before.floats()[k]) << "no gradient reaches it";
          }
        }
      }
      owned += one_hot;
      ASSERT_NEAR(meta.floats()[k], expected, 1e-6) << block.name;
    }
  }
  EXPECT_EQ(owned, 3u * 8 * kTasks);
}

TEST(SacPersonalLearner, EverythingIsPresentWithoutOwnColumns) {
  SacSettings settings = smallSac();
  settings.own_column = false;
  EXPECT_TRUE(makeLearner(settings).personal().present.empty());
  EXPECT_TRUE(makeLearner(smallSac("inference")).personal().present.empty());
  EXPECT_TRUE(makeLearner(smallSac("none")).personal().present.empty());
}

TEST(SacPersonalLearner, OneSeedOneResultWhateverIsEvaluated) {
  for (const char* encoding : {"one_hot", "model", "inference"}) {
    auto a = makeLearner(smallSac(encoding)), b = makeLearner(smallSac(encoding)),
         other = makeLearner(smallSac(encoding));
    const Model meta = a.initialModel(1);
    for (int round = 1; round <= 3; ++round) {
      for (PersonalLearner* learner : {&a, &b, &other}) {
        learner->beginRound(meta, false);
        Rng rng(learner == &other ? 8 : 7, 0, Stream::kSample, round);
        run(*learner, 20, rng);
        if (learner == &b) continue;
        Rng evaluation(7, 0, Stream::kEvaluate);
        learner->evaluate(learner->personal(), evaluation);
        learner->record(meta, evaluation);
        learner->evaluateAdapted(meta, evaluation);
      }
    }
    EXPECT_EQ(a.personal().checksum(), b.personal().checksum());
    EXPECT_EQ(a.auxiliary().checksum(), b.auxiliary().checksum());
    EXPECT_NE(a.personal().checksum(), other.personal().checksum());
  }
}

TEST(SacPersonalLearner, NetworksWithLambdaZeroAreEachRobotsOwn) {
  const SacSettings settings = smallSac();
  PersonalSettings personal = pulled();
  personal.lambdas.critic = 0;
  PersonalLearner learner = makeLearner(settings, 0, personal);
  Rng rng(1, 0, Stream::kSample);
  const Model meta = learner.initialModel(1);
  learner.beginRound(meta, false);
  run(learner, 20, rng);
  const std::vector<float> trained = learner.personal().floats();
  const std::size_t critics = sac(learner).networks().criticOffset(0);
  EXPECT_TRUE(std::equal(meta.floats().begin() + critics, meta.floats().end(),
                         learner.auxiliary().floats().begin() + critics));
  EXPECT_FALSE(std::equal(meta.floats().begin(), meta.floats().begin() + critics,
                          learner.auxiliary().floats().begin()));
  learner.beginRound(meta, false);
  EXPECT_TRUE(std::equal(meta.floats().begin(), meta.floats().begin() + critics,
                         learner.personal().floats().begin()));
  EXPECT_TRUE(std::equal(trained.begin() + critics, trained.end(),
                         learner.personal().floats().begin() + critics));
}

TEST(SacPersonalLearner, UpdatesAllocateNothing) {
  for (const char* encoding : {"one_hot", "model", "inference"}) {
    auto learner = makeLearner(smallSac(encoding));
    Rng rng(1, 0, Stream::kSample);
    learner.beginRound(learner.initialModel(1), false);
    run(learner, 1, rng);
    const std::size_t before = test::allocations();
    run(learner, 300, rng);
    EXPECT_EQ(test::allocations() - before, 0u);
  }
}

TEST(SacPersonalLearner, RefusesATaskThatIsNone) {
  EXPECT_EQ(test::errorOf([] { makeLearner(smallSac(), 3); }), "task 3 is none of 3.");
}

// personal and meta-policy of three goals that conflict, told apart by a one-hot vector
TEST(SacPersonalLearner, RoundsGiveOneMetaPolicyForAllGoals) {
  SacSettings settings;
  settings.hidden = {32, 32};
  settings.batch_size = 32;
  settings.warm_up_steps = 200;
  settings.gamma = 0.9;
  PersonalSettings pull = pulled();
  pull.learning_rate = 3e-3;
  const auto learners = test::makeLearners(settings, pull);
  Model meta = learners[0]->initialModel(0);
  const auto meanReturn = [&](bool personal) {
    double sum = 0;
    for (const auto& learner : learners) {
      Rng rng(1, 0, Stream::kEvaluate);
      sum += learner->evaluate(personal ? learner->personal() : meta, rng).mean / kTasks;
    }
    return sum;
  };
  const double untrained = meanReturn(false);
  for (std::uint64_t round = 0; round < 30; ++round) test::trainRound(learners, meta, 50, 0, round);
  EXPECT_GT(meanReturn(true), 0.4 * untrained);
  EXPECT_GT(meanReturn(false), 0.4 * untrained);
}

}  // namespace
}  // namespace pmeta
