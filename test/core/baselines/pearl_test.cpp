// PEARL learns to tell tasks apart, collects as it is said, and goes on as it was.
#include "pmeta_core/baselines/pearl.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "allocations.h"
#include "baselines/opposite_goals.h"
#include "memory_state.h"
#include "support.h"

namespace pmeta {
namespace {

PearlSettings goalSettings() {
  PearlSettings settings;
  settings.sac.hidden = settings.sac.context.hidden = {64, 64};
  settings.sac.gamma = 0.9;
  settings.sac.context.batch_size = 64;
  settings.warm_up_steps = settings.prior_steps = settings.posterior_steps = 60;
  settings.updates_per_iteration = 100;
  return settings;
}

PearlSettings smallSettings() {
  PearlSettings settings = goalSettings();
  settings.sac.hidden = settings.sac.context.hidden = {12, 8};
  settings.sac.context.batch_size = 16;
  settings.task_batch = 8;
  settings.updates_per_iteration = 10;
  return settings;
}

void train(Pearl& learner, std::uint64_t first, std::uint64_t end) {
  for (std::uint64_t k = first; k < end; ++k) learner.iterate(1, k);
}

// the mean of the last four of ten evaluations, and the worse task of the best of all
void expectApart(PearlSettings settings) {
  Pearl learner(test::oppositeGoals(), settings);
  learner.setModel(test::initialModel(learner, 1));
  double last = 0, worse = -1e9;
  for (int evaluation = 0; evaluation < 10; ++evaluation) {
    const auto first = static_cast<std::uint64_t>(12 * evaluation);
    train(learner, first, first + 12);
    const test::GoalReturns goals = test::evaluateOnGoals(learner, {2});
    if (evaluation >= 6) last += goals.mean(1) / 4;
    worse = std::max(worse, goals.worse(1));
  }
  EXPECT_GT(last, -14);
  EXPECT_GT(worse, -10);
}

TEST(Pearl, LearnsToTellOppositeGoalsApart) { expectApart(goalSettings()); }

TEST(Pearl, LearnsByAValueNetworkToo) {
  PearlSettings settings = goalSettings();
  settings.sac.backbone = "value";
  settings.sac.temperature.temperature = "fixed";
  expectApart(settings);
}

TEST(Pearl, AnUntrainedPolicyIsEvaluatedToo) {
  Pearl learner(test::oppositeGoals(), smallSettings());
  learner.setModel(test::initialModel(learner, 1));
  const test::GoalReturns goals = test::evaluateOnGoals(learner, {2});
  EXPECT_EQ(goals.episodes, (std::vector<int>{0, 2}));
  for (const std::size_t k : {0, 1}) {
    EXPECT_NEAR(goals.mean(k), -20, 1);
  }
}

TEST(Pearl, VisitsDrawnTasksInWholeEpisodes) {
  PearlSettings settings = smallSettings();
  settings.tasks_per_iteration = 5;
  settings.warm_up_steps = 30;  // two episodes of 20 steps
  settings.prior_steps = 41;    // three
  settings.posterior_steps = 20;
  Pearl learner(test::oppositeGoals(), settings);
  learner.setModel(test::initialModel(learner, 1));
  std::int64_t visited_first = 0;
  std::vector<std::int64_t> kept(2);
  std::vector<std::size_t> context(2, 40);
  for (std::uint64_t k = 0; k < 6; ++k) {
    const IterationStats stats = learner.iterate(1, k);
    const std::int64_t warm_up = k == 0 ? 40 : 0;
    EXPECT_EQ(stats.env_steps[0] + stats.env_steps[1], 5 * 80 + 2 * warm_up);
    EXPECT_EQ((stats.env_steps[0] - warm_up) % 80, 0);
    EXPECT_EQ(stats.updates, 10);
    visited_first += (stats.env_steps[0] - warm_up) / 80;
    for (const std::size_t i : {0, 1}) {
      kept[i] += stats.env_steps[i];
      EXPECT_EQ(learner.task(i).replay().size(), static_cast<std::size_t>(kept[i]));
      // of the last visit what was explored on the prior, before any the warm-up
      if (stats.env_steps[i] > warm_up) context[i] = 60;
      EXPECT_EQ(learner.task(i).context().kept().size(), context[i]);
    }
  }
  EXPECT_GT(visited_first, 5);
  EXPECT_LT(visited_first, 25);
}

TEST(Pearl, PosteriorEpisodesAreContextOnDemand) {
  PearlSettings settings = smallSettings();
  settings.tasks_per_iteration = 20;  // both, all but surely
  settings.sac.context.posterior_episodes = true;
  Pearl learner(test::oppositeGoals(), settings);
  learner.setModel(test::initialModel(learner, 1));
  learner.iterate(1, 0);
  for (const std::size_t i : {0, 1}) EXPECT_EQ(learner.task(i).context().kept().size(), 120u);
}

// the reward that trains and the one that tasks are told apart by
TEST(Pearl, ContextCountsTheSparseReward) {
  MetaTasks tasks;
  auto family = std::make_shared<SparsePointFamily>();
  family->build(0);
  tasks.family = family;
  Pearl learner(tasks, smallSettings());
  learner.setModel(test::initialModel(learner, 1));
  learner.iterate(1, 0);
  const ReplayBuffer& replay = learner.task(0).replay();
  const ReplayBuffer& context = learner.task(0).context().kept();
  for (std::size_t k = 0; k < replay.size(); ++k) EXPECT_LT(replay[k].reward, 0);
  for (std::size_t k = 0; k < context.size(); ++k) EXPECT_GE(context[k].reward, 0);
}

TEST(Pearl, UpdatesAllocateNothing) {
  Pearl learner(test::oppositeGoals(), smallSettings());
  learner.setModel(test::initialModel(learner, 1));
  learner.iterate(1, 0);
  Rng rng(1, 0, Stream::kSample, 1);
  const std::size_t before = test::allocations();
  for (int k = 0; k < 5; ++k) learner.update(rng);
  EXPECT_EQ(test::allocations() - before, 0u);
}

TEST(Pearl, ThreadsChangeNothing) {
  std::vector<Model> models;
  for (const int threads : {1, 3}) {
    Pearl learner(test::oppositeGoals(0, threads), smallSettings());
    learner.setModel(test::initialModel(learner, 1));
    train(learner, 0, 3);
    models.push_back(learner.model());
  }
  EXPECT_EQ(models[0], models[1]);
}

class PearlResumed : public ::testing::TestWithParam<const char*> {};

TEST_P(PearlResumed, IsUninterrupted) {
  PearlSettings settings = smallSettings();
  settings.sac.backbone = GetParam();
  if (settings.sac.backbone == "value") settings.sac.temperature.temperature = "fixed";
  Pearl whole(test::oppositeGoals(), settings);
  whole.setModel(test::initialModel(whole, 1));
  train(whole, 0, 3);

  Pearl first(test::oppositeGoals(), settings);
  first.setModel(test::initialModel(first, 1));
  train(first, 0, 1);
  Pearl second(test::oppositeGoals(), settings);
  second.setModel(first.model());
  test::load(second, test::stateOf(first));
  train(second, 1, 3);
  EXPECT_EQ(second.model(), whole.model());
  EXPECT_EQ(test::stateOf(second), test::stateOf(whole));
  for (std::size_t i = 0; i < whole.losses().size(); ++i) {
    EXPECT_EQ(second.losses()[i].value, whole.losses()[i].value) << whole.losses()[i].name;
  }
}

INSTANTIATE_TEST_SUITE_P(Backbones, PearlResumed, ::testing::Values("twin", "value"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Pearl, RefusesAStateWithoutTransitions) {
  Pearl learner(test::oppositeGoals(), smallSettings());
  test::MemoryState state = test::stateOf(learner);
  state.set<std::uint8_t>("started", {1});
  EXPECT_NE(test::errorOf([&] { test::load(learner, state); }).find("task_0"), std::string::npos);
}

std::string errorOf(const std::vector<std::string>& assignments, int num_tasks = 2) {
  PearlKind kind;
  Settings settings;
  kind.bind(settings);
  return test::errorOf([&] {
    for (const std::string& one : assignments) settings.assign(one);
    kind.check(num_tasks);
  });
}

TEST(Pearl, RefusesSettingsThatDoNotGoTogether) {
  EXPECT_EQ(errorOf({}), "(no error)");
  EXPECT_EQ(errorOf({}, 1),
            "PEARL learns to tell tasks apart and needs two or more to train on, but the "
            "environment has 1.");
  EXPECT_EQ(errorOf({"pearl.backbone:=value"}),
            "pearl.backbone value has no target entropy: set pearl.temperature to fixed, or "
            "pearl.backbone to twin.");
  EXPECT_EQ(errorOf({"pearl.backbone:=value", "pearl.temperature:=fixed"}), "(no error)");
  EXPECT_EQ(errorOf({"pearl.exploration_episodes:=[15, 5]"}),
            "pearl.exploration_episodes must be ascending, e.g. [5, 15].");
}

TEST(Pearl, RefusesReplaysBeyondTheMachine) {
  PearlSettings settings = smallSettings();
  settings.buffer_size = 1000000000;
  const std::string error =
      test::errorOf([&] { Pearl learner(test::oppositeGoals(100000000000000), settings); });
  EXPECT_EQ(error.find("the replays of 2 tasks would come to 2000000000 transitions"), 0u) << error;
  EXPECT_NE(error.find("set pearl.buffer_size to at most"), std::string::npos) << error;
}

TEST(Pearl, IsRegistered) {
  const MetaLearnerRow& row = metaLearners().at("pearl");
  EXPECT_EQ(row.label, "PEARL");
  const auto kind = row.make();
  EXPECT_EQ(kind->explorationEpisodes(), (std::vector<int>{2}));
  EXPECT_EQ(kind->metaInput(-1, 2), std::vector<float>(5));
  const test::DensePoint env({1, 0});
  const auto learner = kind->make(test::oppositeGoals());
  EXPECT_EQ(kind->policies(env, 2)->layout(), learner->policies().layout());
}

}  // namespace
}  // namespace pmeta
