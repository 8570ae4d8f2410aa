#include "pmeta_core/env/walker2d.h"

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

std::shared_ptr<const MujocoModel> model() {
  static const auto kModel = MujocoModel::open("", Walker2d::layout());
  return kModel;
}

// positions in Walker2d::state()
constexpr int kHeight = 1, kPitch = 2, kVelocity = 9;

TEST(Walker2d, SaysWhatAnAgentMustKnow) {
  const Walker2d env(model());
  EXPECT_EQ(env.spec().name, "walker_2d_params");
  EXPECT_EQ(env.spec().observation_size, 17);
  EXPECT_EQ(env.spec().action_size, 6);
  EXPECT_EQ(env.spec().num_actions, 0);
  EXPECT_EQ(env.spec().horizon, 200);
}

TEST(Walker2d, RewardsVelocityAndBeingAlive) {
  Walker2d env(model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 5; ++i) {
    const double before = env.state()[0];
    const Step step = driven.randomStep();
    const double velocity = (env.state()[0] - before) / 0.016;
    double squares = 0;
    for (const double a : driven.action) squares += a * a;
    EXPECT_DOUBLE_EQ(env.forwardVelocity(), velocity);
    EXPECT_DOUBLE_EQ(env.controlCost(), 0.001 * squares);
    EXPECT_DOUBLE_EQ(step.reward, velocity + 1 - 0.001 * squares);
  }
}

TEST(Walker2d, TerminatesUnlessUpright) {
  Walker2d env(model());
  Driven driven(env);
  const auto ends = [&](int index, double value) {
    driven.reset();
    std::vector<double> state = env.state();
    state[index] = value;
    for (int i = 0; i < 18; ++i) state[kVelocity + i] = 0;
    env.setState(state);
    return driven.step().terminated;
  };
  EXPECT_FALSE(ends(kHeight, 1.25));
  EXPECT_FALSE(ends(kHeight, 1.9));
  EXPECT_TRUE(ends(kHeight, 2.1));
  EXPECT_TRUE(ends(kHeight, 0.5));
  EXPECT_FALSE(ends(kPitch, 0.9));
  EXPECT_TRUE(ends(kPitch, 1.1));
  EXPECT_TRUE(ends(kPitch, -1.1));
}

TEST(Walker2d, ObservesVelocitiesUpToTen) {
  Walker2d env(model());
  Driven driven(env);
  driven.reset();
  std::vector<double> state = env.state();
  state[kVelocity] = -15;
  state[kVelocity + 1] = 12;
  env.setState(state);
  driven.step();
  state = env.state();
  ASSERT_LT(state[kVelocity], -10);
  ASSERT_GT(state[kVelocity + 1], 10);
  EXPECT_EQ(driven.observation[8], -10);
  EXPECT_EQ(driven.observation[9], 10);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(driven.observation[i], state[1 + i]);
  EXPECT_EQ(driven.observation[10], state[kVelocity + 2]);
}

TEST(Walker2d, ClipsActionsAllocatesNothingAndRefusesNan) {
  Walker2d env(model());
  test::expectClippedActions(env);
  test::expectNoAllocationInSteps(env);
  Driven driven(env);
  driven.reset();
  driven.action[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(errorOf([&] { driven.step(); }),
            "walker_2d_params, step 1: action[3] (thigh_left) is not finite; the episode cannot go "
            "on, reset it.");
}

TEST(Walker2d, TheHorizonTruncates) {
  Walker2d env(model(), 3);
  Driven driven(env);
  driven.reset();
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(driven.step().truncated, i == 3);
}

TEST(Walker2d, StartsNearUprightWithUniformNoise) {
  Walker2d env(model());
  Driven driven(env);
  std::vector<double> noise;
  for (int i = 0; i < 400; ++i) {
    driven.reset();
    std::vector<double> state = env.state();
    state[kHeight] -= 1.25;
    noise.insert(noise.end(), state.begin(), state.begin() + 18);
  }
  test::expectUniform(noise, -0.005, 0.005);
}

TEST(Walker2d, GoesOnFromASavedStateToTheBit) {
  const BuiltFamily<Walker2dParamsFamily> f, again;
  const auto env = f.family.make(4), other = again.family.make(4);
  Driven driven(*env), same(*other);
  driven.reset();
  for (int i = 0; i < 10; ++i) driven.randomStep();
  const std::vector<double> saved = env->state();
  other->setState(saved);
  EXPECT_EQ(other->state(), saved);
  same.rng.setState(driven.rng.state());
  for (int i = 0; i < 40; ++i) {
    const double reward = driven.randomStep().reward;
    ASSERT_EQ(same.randomStep().reward, reward);
    ASSERT_EQ(same.observation, driven.observation);
    ASSERT_EQ(other->state(), env->state());
  }
}

TEST(Walker2dTask, FactorsAreLogUniform) {
  Rng rng(1, 0, Stream::kMeasure);
  std::vector<double> damping, others;
  for (int i = 0; i < 100; ++i) {
    const Walker2dTask task = drawWalker2dTask(*model(), rng);
    ASSERT_EQ(task.body_mass.size(), 8u);
    ASSERT_EQ(task.body_inertia.size(), 24u);
    ASSERT_EQ(task.dof_damping.size(), 9u);
    ASSERT_EQ(task.geom_friction.size(), 24u);
    for (const double f : task.dof_damping) damping.push_back(std::log(f) / std::log(1.3));
    for (const auto* list : {&task.body_mass, &task.body_inertia, &task.geom_friction}) {
      for (const double f : *list) others.push_back(std::log(f) / std::log(1.5));
    }
  }
  test::expectUniform(damping, -3, 3);
  test::expectUniform(others, -3, 3);
}

TEST(Walker2dTask, OfOtherSizesAreRefused) {
  Rng rng(1, 0, Stream::kMeasure);
  Walker2dTask task = drawWalker2dTask(*model(), rng);
  task.dof_damping.pop_back();
  EXPECT_EQ(errorOf([&] { applyWalker2dTask(*model(), task); }),
            "a walker's task has 8 factors of dof_damping but the model has 9 figures.");
}

TEST(Walker2dParamsFamily, DrawsTasksFromTheSeedSplitBySplit) {
  const BuiltFamily<Walker2dParamsFamily> f({}, 7), again({}, 7), other({}, 8);
  const BuiltFamily<Walker2dParamsFamily> fewer({"train_tasks:=2", "test_tasks:=4"}, 7);
  ASSERT_EQ(f.family.numTasks(), 10);
  ASSERT_EQ(f.family.numTestTasks(), 3);
  const auto mass = [](const auto& built, int task) { return built.family.task(task).body_mass; };
  for (int i = 0; i < 13; ++i) {
    EXPECT_EQ(mass(f, i), mass(again, i));
    EXPECT_NE(mass(f, i), mass(other, i));
    for (int j = 0; j < i; ++j) EXPECT_NE(mass(f, i), mass(f, j));
  }
  for (int i = 0; i < 2; ++i) EXPECT_EQ(mass(fewer, i), mass(f, i));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(mass(fewer, 2 + i), mass(f, 10 + i));
  EXPECT_EQ(f.family.taskName(9), "walker_2d_params_9");
  EXPECT_EQ(f.family.taskName(10), "walker_2d_params_test_0");
}

TEST(Walker2dParamsFamily, ATaskIsItsSeed) {
  const BuiltFamily<Walker2dParamsFamily> drawn({}, 3);
  const std::string description = drawn.family.taskDescription(11);
  const std::string start = "model of task_seed ";
  ASSERT_EQ(description.find(start), 0u) << description;
  EXPECT_NE(description.find(" kg (base 23.7), friction of the feet "), std::string::npos)
      << description;
  const std::string seed = description.substr(start.size(), description.find(':') - start.size());
  const BuiltFamily<Walker2dParamsFamily> given(
      {"task_seeds:=[5, " + seed + "]", "test_task_seeds:=[6]"});
  ASSERT_EQ(given.family.numTasks(), 2);
  ASSERT_EQ(given.family.numTestTasks(), 1);
  EXPECT_EQ(given.family.taskDescription(1), description);
  EXPECT_EQ(given.family.task(1).geom_friction, drawn.family.task(11).geom_friction);
}

TEST(Walker2dParamsFamily, RefusesBadSettings) {
  EXPECT_NE(familyError<Walker2dParamsFamily>({"task_seeds:=[-1]"}), "(no error)");
  EXPECT_NE(familyError<Walker2dParamsFamily>({"task_seeds:=[1.5]"}), "(no error)");
  EXPECT_NE(familyError<Walker2dParamsFamily>({"train_tasks:=0"}), "(no error)");
  EXPECT_NE(familyError<Walker2dParamsFamily>({"test_tasks:=-1"}), "(no error)");
}

}  // namespace
}  // namespace pmeta
