// Agents that learn a model of the tasks.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "../support.h"
#include "goal_learners.h"

namespace pmeta {
namespace {

using test::kTasks;
using test::makeLearner;
using test::makeLearners;
using test::pulled;
using test::run;
using test::sac;
using test::smallSac;
using test::trainRound;

SacSettings notExploring() {
  SacSettings settings = smallSac("model");
  settings.task_model.exploring_interval = 0;
  return settings;
}

TEST(SacTaskModel, ActorAndCriticsAreThoseOfOneHotWhereNoEpisodeExplores) {
  auto modelling = makeLearner(notExploring()), told = makeLearner(smallSac());
  const Model meta = modelling.initialModel(1);
  Model same(told.layout());
  std::copy_n(meta.floats().begin(), same.size(), same.floats().begin());
  for (std::uint64_t round = 1; round <= 3; ++round) {
    modelling.beginRound(meta, round > 1);
    told.beginRound(same, round > 1);
    Rng rng(7, 0, Stream::kSample, round), too = rng;
    run(modelling, 30, rng);
    run(told, 30, too);
    EXPECT_EQ(rng.state(), too.state());
  }
  for (const auto& [a, b] : {std::pair(&modelling.personal(), &told.personal()),
                             std::pair(&modelling.auxiliary(), &told.auxiliary())}) {
    EXPECT_TRUE(std::equal(b->floats().begin(), b->floats().end(), a->floats().begin()));
  }
}

TEST(SacTaskModel, TasksBeginAlike) {
  const auto learner = makeLearner(smallSac("model"));
  const Model meta = learner.initialModel(1);
  const SacNetworks& networks = sac(learner).networks();
  EXPECT_EQ(networks.taskWeights().size(), 8u + 8u + 8u + 7u);
  for (const std::size_t weights : networks.taskWeights()) {
    for (std::size_t i = 0; i < kTasks; ++i) EXPECT_EQ(meta.floats()[weights + i], 0);
  }
}

// also of the model: what is sent of other tasks' columns counts for nothing
TEST(SacTaskModel, AColumnIsItsTasksAlone) {
  const auto learners = makeLearners(smallSac("model"), pulled());
  Model meta = learners[0]->initialModel(1);
  trainRound(learners, meta, 30, 7, 0);
  for (const std::size_t weights : sac(*learners[0]).networks().taskWeights()) {
    for (std::size_t task = 0; task < learners.size(); ++task) {
      EXPECT_EQ(meta.floats()[weights + task],
                learners[task]->auxiliary().floats()[weights + task]);
    }
  }
}

TEST(SacTaskModel, KeepsEveryEpisodeButLearnsToActFromItsOwn) {
  SacSettings settings = smallSac("model");
  settings.buffer_size = settings.task_model.buffer_size = 1000;
  auto own = makeLearner(settings);
  settings.task_model.explored_to_replay = true;
  auto all = makeLearner(settings);
  for (PersonalLearner* learner : {&own, &all}) {
    learner->beginRound(learner->initialModel(1), false);
    Rng rng(7, 0, Stream::kSample);
    run(*learner, 200, rng);
    EXPECT_EQ(sac(*learner).modelled().size(), 230u);
  }
  EXPECT_EQ(sac(all).replay().size(), 230u);
  // after the warm-up and the episode begun at its end 19 of 10 steps, of which every second
  // explores
  EXPECT_EQ(sac(own).replay().size(), 140u);
}

TEST(SacTaskModel, SaysHowWellTheModelFits) {
  auto learner = makeLearner(smallSac("model"));
  learner.beginRound(learner.initialModel(1), false);
  Rng rng(7, 0, Stream::kSample);
  run(learner, 5, rng);
  ASSERT_EQ(learner.losses().back().name, "task_model");
  const double at_first = learner.losses().back().value;
  run(learner, 400, rng);
  EXPECT_LT(learner.losses().back().value, at_first / 2);
}

TEST(SacTaskModel, PullHasTheStrengthOfTheInferenceNetwork) {
  PersonalSettings personal = pulled();
  personal.lambdas.encoder = 0;
  auto learner = makeLearner(smallSac("model"), 1, personal);
  const Model meta = learner.initialModel(1);
  learner.beginRound(meta, false);
  Rng rng(7, 0, Stream::kSample);
  run(learner, 20, rng);
  const auto begin = static_cast<std::ptrdiff_t>(sac(learner).networks().taskModelOffset());
  EXPECT_TRUE(std::equal(meta.floats().begin() + begin, meta.floats().end(),
                         learner.auxiliary().floats().begin() + begin));
  EXPECT_FALSE(std::equal(meta.floats().begin() + begin, meta.floats().end(),
                          learner.personal().floats().begin() + begin));
}

// three goals that conflict: what lacks to a policy that is told the task is not inference
TEST(SacTaskModel, ExploringIsAsGoodAsBeingTold) {
  SacSettings settings;
  settings.hidden = {32, 32};
  settings.batch_size = 32;
  settings.warm_up_steps = 200;
  settings.gamma = 0.9;
  settings.task_encoding = "model";
  settings.task_model.hidden = {24, 24};
  PersonalSettings personal = pulled();
  personal.learning_rate = 3e-3;
  const auto learners = makeLearners(settings, personal);
  Model meta = learners[0]->initialModel(0);
  for (std::uint64_t round = 0; round < 40; ++round) trainRound(learners, meta, 50, 0, round);
  double before = 0, after = 0;
  for (int task = 0; task < kTasks; ++task) {
    const PersonalLearner& learner = *learners[static_cast<std::size_t>(task)];
    Rng rng(1, 0, Stream::kEvaluate), same = rng;
    const std::vector<AdaptedReturn> returns = learner.evaluateAdapted(meta, rng);
    ASSERT_EQ(returns.size(), 2u);
    EXPECT_EQ(returns[1].task_input, oneHot(task, kTasks));
    EXPECT_EQ(returns[1].stats.mean, learner.evaluate(meta, same).mean) << "to the last digit";
    before += returns[0].stats.mean;
    after += returns[1].stats.mean;
  }
  EXPECT_GT(after, 0.6 * before);
}

}  // namespace
}  // namespace pmeta
