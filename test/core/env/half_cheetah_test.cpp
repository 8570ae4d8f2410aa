#include "pmeta_core/env/half_cheetah.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "continuous_env.h"

namespace pmeta {
namespace {

using test::BuiltFamily;
using test::Driven;
using test::errorOf;
using test::familyError;
using Goal = HalfCheetahTask::Goal;

std::shared_ptr<const MujocoModel> model() {
  static const auto kModel = MujocoModel::open("", HalfCheetah::layout());
  return kModel;
}

TEST(HalfCheetah, SaysWhatAnAgentMustKnow) {
  const HalfCheetah env({Goal::kVelocity, 2}, model());
  EXPECT_EQ(env.spec().name, "half_cheetah_vel");
  EXPECT_EQ(env.spec().observation_size, 20);
  EXPECT_EQ(env.spec().action_size, 6);
  EXPECT_EQ(env.spec().num_actions, 0);
  EXPECT_EQ(env.spec().horizon, 200);
  EXPECT_EQ(HalfCheetah({Goal::kDirection, 1}, model(), 64).spec().horizon, 64);
}

TEST(HalfCheetah, ItsConfigurationIsTheBeginningOfItsState) {
  HalfCheetah env({Goal::kDirection, 1}, model());
  Driven driven(env);
  driven.reset();
  driven.randomStep();
  const std::vector<double> state = env.state();
  EXPECT_EQ(env.configuration(), std::vector<double>(state.begin(), state.begin() + 9));
}

TEST(HalfCheetah, RewardsVelocityOrBeingNearOne) {
  EXPECT_EQ(HalfCheetah::reward({Goal::kDirection, 1}, 2, 0.1), 1.9);
  EXPECT_EQ(HalfCheetah::reward({Goal::kDirection, -1}, 2, 0.1), -2.1);
  EXPECT_EQ(HalfCheetah::reward({Goal::kVelocity, 0.5}, 2, 0.1), -1.6);
  EXPECT_EQ(HalfCheetah::reward({Goal::kVelocity, 2.5}, 2, 0.25), -0.75);

  HalfCheetah env({Goal::kDirection, -1}, model());
  Driven driven(env);
  driven.reset();
  const double before = env.state()[0];
  driven.action = {1, -0.5, 0, 0.25, 3, -1};
  const Step step = driven.step();
  const double u = (env.state()[0] - before) / 0.05;
  EXPECT_DOUBLE_EQ(env.forwardVelocity(), u);
  EXPECT_DOUBLE_EQ(env.controlCost(), 0.05 * (1 + 0.25 + 0.0625 + 1 + 1));
  EXPECT_DOUBLE_EQ(step.reward, -u - env.controlCost());
  EXPECT_FALSE(step.sparse_reward.has_value());
}

TEST(HalfCheetah, ObservesInSinglePrecision) {
  HalfCheetah env({}, model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 20; ++i) driven.randomStep();
  const std::vector<double> state = env.state();
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(driven.observation[i], static_cast<float>(state[1 + i])) << i;
  }
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(driven.observation[8 + i], static_cast<float>(state[9 + i])) << i;
  }
  // of the last evaluation within the step, so not where the step ended
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(driven.observation[17 + i], static_cast<float>(state[27 + i])) << i;
  }
  EXPECT_NE(driven.observation[17], static_cast<float>(state[0]));
  EXPECT_NEAR(driven.observation[17], state[0], 0.1);
}

TEST(HalfCheetah, ClipsActionsAndAllocatesNothing) {
  HalfCheetah env({}, model());
  test::expectClippedActions(env);
  test::expectNoAllocationInSteps(env);
}

TEST(HalfCheetah, RefusesActionsThatAreNotFinite) {
  HalfCheetah env({}, model());
  Driven driven(env);
  driven.reset();
  driven.randomStep();
  driven.action[5] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(errorOf([&] { driven.step(); }),
            "half_cheetah_dir, step 2: action[5] (ffoot) is not finite; the episode cannot go on, "
            "reset it.");
  // and goes on after a reset
  driven.reset();
  EXPECT_TRUE(std::isfinite(driven.randomStep().reward));
}

TEST(HalfCheetah, OnlyTheHorizonEndsAnEpisode) {
  HalfCheetah env({}, model());
  Driven driven(env);
  for (int episode = 0; episode < 2; ++episode) {
    driven.reset();
    for (int i = 1; i <= 200; ++i) {
      const Step step = driven.randomStep();
      ASSERT_FALSE(step.terminated);
      ASSERT_EQ(step.truncated, i == 200) << i;
    }
  }
}

TEST(HalfCheetah, StartsWithUniformPositionsAndNormalVelocities) {
  HalfCheetah env({}, model());
  Driven driven(env);
  std::vector<double> positions, velocities;
  for (int i = 0; i < 600; ++i) {
    driven.reset();
    const std::vector<double> state = env.state();
    positions.insert(positions.end(), state.begin(), state.begin() + 9);
    velocities.insert(velocities.end(), state.begin() + 9, state.begin() + 18);
    ASSERT_EQ(state.back(), 0);
    // a start is evaluated: the torso is where its coordinates say
    ASSERT_NEAR(state[27], state[0], 1e-15);
    ASSERT_NEAR(state[29], 0.7 + state[1], 1e-15);
  }
  test::expectUniform(positions, -0.1, 0.1);
  test::expectNormal(velocities, 0.1);
}

TEST(HalfCheetah, GoesOnFromASavedStateInAnotherProcessToTheBit) {
  HalfCheetah env({}, model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 50; ++i) driven.randomStep();
  const std::vector<double> saved = env.state();
  EXPECT_EQ(saved.size(), 9u + 9 + 9 + 3 + 1);
  HalfCheetah other({}, MujocoModel::open("", HalfCheetah::layout()));
  other.setState(saved);
  EXPECT_EQ(other.state(), saved);
  Driven same(other);
  same.rng.setState(driven.rng.state());
  for (int i = 0; i < 100; ++i) {
    const double reward = driven.randomStep().reward;
    ASSERT_EQ(same.randomStep().reward, reward);
    ASSERT_EQ(same.observation, driven.observation);
    ASSERT_EQ(other.state(), env.state());
  }
}

TEST(HalfCheetahDirFamily, TrainsAndTestsBothDirections) {
  const BuiltFamily<HalfCheetahDirFamily> f;
  ASSERT_EQ(f.family.numTasks(), 2);
  ASSERT_EQ(f.family.numTestTasks(), 2);
  for (const int test : {0, 2}) {
    EXPECT_EQ(f.family.task(test).value, -1);
    EXPECT_EQ(f.family.task(test + 1).value, 1);
    EXPECT_EQ(f.family.taskDescription(test), "run backward");
    EXPECT_EQ(f.family.taskDescription(test + 1), "run forward");
  }
  EXPECT_EQ(f.family.taskName(1), "half_cheetah_dir_1");
  EXPECT_EQ(f.family.taskName(2), "half_cheetah_dir_test_0");
  const auto env = f.family.make(0);
  EXPECT_EQ(env->spec().name, "half_cheetah_dir");
  EXPECT_EQ(dynamic_cast<HalfCheetah&>(*env).task().value, -1);

  const BuiltFamily<HalfCheetahDirFamily> one(
      {"directions:=[1]", "test_directions:=[]", "horizon:=64"});
  EXPECT_EQ(one.family.numTasks(), 1);
  EXPECT_EQ(one.family.numTestTasks(), 0);
  EXPECT_EQ(one.family.make(0)->spec().horizon, 64);
}

TEST(HalfCheetahVelFamily, DrawsTasksFromTheSeedSplitBySplit) {
  const BuiltFamily<HalfCheetahVelFamily> f({}, 7);
  ASSERT_EQ(f.family.numTasks(), 10);
  ASSERT_EQ(f.family.numTestTasks(), 3);
  const BuiltFamily<HalfCheetahVelFamily> again({}, 7), other({}, 8);
  const BuiltFamily<HalfCheetahVelFamily> fewer({"train_tasks:=4", "test_tasks:=5"}, 7);
  ASSERT_EQ(fewer.family.numTasks(), 4);
  ASSERT_EQ(fewer.family.numTestTasks(), 5);
  for (int i = 0; i < 13; ++i) {
    EXPECT_EQ(f.family.task(i).goal, Goal::kVelocity);
    EXPECT_EQ(f.family.task(i).value, again.family.task(i).value);
    EXPECT_NE(f.family.task(i).value, other.family.task(i).value);
    for (int j = 0; j < i; ++j) EXPECT_NE(f.family.task(i).value, f.family.task(j).value);
  }
  for (int i = 0; i < 4; ++i) EXPECT_EQ(fewer.family.task(i).value, f.family.task(i).value);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(fewer.family.task(4 + i).value, f.family.task(10 + i).value);
  }
  EXPECT_EQ(f.family.taskName(9), "half_cheetah_vel_9");
  EXPECT_EQ(f.family.taskName(12), "half_cheetah_vel_test_2");
  EXPECT_EQ(f.family.taskDescription(3), "run at " + formatNumber(f.family.task(3).value) + " m/s");

  const BuiltFamily<HalfCheetahVelFamily> many({"train_tasks:=2000", "test_tasks:=2000"});
  std::vector<double> train, test;
  for (int i = 0; i < 2000; ++i) {
    train.push_back(many.family.task(i).value);
    test.push_back(many.family.task(2000 + i).value);
  }
  test::expectUniform(train, 0, 3);
  test::expectUniform(test, 0, 3);
}

TEST(HalfCheetahVelFamily, TakesVelocitiesAsGiven) {
  const BuiltFamily<HalfCheetahVelFamily> f({"velocities:=[0.5, 1, -2]", "test_velocities:=[2.5]"});
  ASSERT_EQ(f.family.numTasks(), 3);
  ASSERT_EQ(f.family.numTestTasks(), 1);
  EXPECT_EQ(f.family.task(2).value, -2);
  EXPECT_EQ(f.family.task(3).value, 2.5);
  EXPECT_EQ(f.family.taskDescription(3), "run at 2.5 m/s");
  // effective settings read back
  Settings settings;
  HalfCheetahVelFamily family;
  family.bind(settings);
  settings.read(parseYaml(settings.yaml(), "a.yaml"), "a.yaml");
  settings.read(parseYaml(f.settings.yaml(), "b.yaml"), "b.yaml");
  EXPECT_EQ(settings.yaml(), f.settings.yaml());
}

TEST(HalfCheetahFamilies, RefuseBadSettings) {
  EXPECT_EQ(familyError<HalfCheetahDirFamily>({"directions:=[1, 0.5]"}),
            "environment.directions holds 0.5 but must hold 1 (forward) and -1 (backward) only.");
  EXPECT_EQ(familyError<HalfCheetahDirFamily>({"directions:=[]"}),
            "environment.directions is '[]' (given as directions:=[]) but must be a list of "
            "numbers, from -1 to 1.");
  EXPECT_NE(familyError<HalfCheetahDirFamily>({"test_directions:=[2]"}), "(no error)");
  EXPECT_NE(familyError<HalfCheetahVelFamily>({"velocities:=[1000]"}), "(no error)");
  EXPECT_NE(familyError<HalfCheetahVelFamily>({"train_tasks:=0"}), "(no error)");
  EXPECT_NE(familyError<HalfCheetahVelFamily>({"test_tasks:=-1"}), "(no error)");
  EXPECT_NE(familyError<HalfCheetahVelFamily>({"horizon:=0"}), "(no error)");
  EXPECT_NE(
      familyError<HalfCheetahVelFamily>({"model_file:=/nowhere/a.xml"}).find("/nowhere/a.xml"),
      std::string::npos);
}

}  // namespace
}  // namespace pmeta
