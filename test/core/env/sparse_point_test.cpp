#include "pmeta_core/env/sparse_point.h"

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

constexpr double kPi = 3.141592653589793;

TEST(SparsePoint, SaysWhatAnAgentMustKnow) {
  const SparsePoint env({});
  EXPECT_EQ(env.spec().name, "sparse_point_robot");
  EXPECT_EQ(env.spec().observation_size, 2);
  EXPECT_EQ(env.spec().action_size, 2);
  EXPECT_EQ(env.spec().num_actions, 0);
  EXPECT_EQ(env.spec().horizon, 20);
}

TEST(SparsePoint, MovesByATenthOfTheAction) {
  SparsePoint env({0, 1});
  Driven driven(env);
  driven.reset();
  EXPECT_EQ(env.state(), (std::vector<double>{0, 0, 0}));
  driven.action = {0.5, -1};
  const Step step = driven.step();
  EXPECT_DOUBLE_EQ(driven.observation[0], 0.05);
  EXPECT_DOUBLE_EQ(driven.observation[1], -0.1);
  EXPECT_DOUBLE_EQ(step.reward, -std::sqrt(0.05 * 0.05 + 1.1 * 1.1));
  EXPECT_FALSE(step.terminated);
}

TEST(SparsePoint, CountsWhatIsWithinTheRadius) {
  // at rest at a distance d of the goal
  const auto at = [](double d) {
    SparsePoint env({d, 0}, 0.25);
    Driven driven(env);
    driven.reset();
    return driven.step();
  };
  for (const double d : {0.0, 0.1, 0.25}) {
    EXPECT_EQ(at(d).reward, -d);
    EXPECT_EQ(at(d).evaluatedReward(), 1 - d);
  }
  EXPECT_EQ(at(0.2500001).evaluatedReward(), 0);
  EXPECT_EQ(at(2).evaluatedReward(), 0);
  EXPECT_EQ(at(2).reward, -2);
}

TEST(SparsePoint, ClipsActionsAllocatesNothingAndRefusesNan) {
  SparsePoint env({});
  test::expectClippedActions(env);
  test::expectNoAllocationInSteps(env);
  Driven driven(env);
  driven.reset();
  driven.action[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(errorOf([&] { driven.step(); }),
            "sparse_point_robot, step 1: action[1] is not finite.");
}

TEST(SparsePoint, OnlyTheHorizonEndsAnEpisode) {
  SparsePoint env({});
  Driven driven(env);
  for (int episode = 0; episode < 2; ++episode) {
    driven.reset();
    for (int i = 1; i <= 20; ++i) {
      const Step step = driven.randomStep();
      ASSERT_FALSE(step.terminated);
      ASSERT_EQ(step.truncated, i == 20);
    }
  }
}

TEST(SparsePointFamily, SpacesItsGoalsOnTheHalfCircle) {
  const BuiltFamily<SparsePointFamily> f({}, 7);
  ASSERT_EQ(f.family.numTasks(), 10);
  ASSERT_EQ(f.family.numTestTasks(), 3);
  for (int k = 0; k < 10; ++k) {
    EXPECT_NEAR(f.family.task(k).goal_x, std::cos(k * kPi / 9), 1e-15);
    EXPECT_NEAR(f.family.task(k).goal_y, std::sin(k * kPi / 9), 1e-15);
  }
  for (int k = 10; k < 13; ++k) {
    EXPECT_NEAR(std::hypot(f.family.task(k).goal_x, f.family.task(k).goal_y), 1, 1e-15);
    EXPECT_GE(f.family.task(k).goal_y, 0);
  }
  EXPECT_EQ(f.family.taskName(9), "sparse_point_robot_9");
  EXPECT_EQ(f.family.taskName(10), "sparse_point_robot_test_0");
  EXPECT_EQ(f.family.taskDescription(0), "goal at (1.000, 0.000), angle 0 rad");

  const BuiltFamily<SparsePointFamily> more({"train_tasks:=3", "test_tasks:=4"}, 7);
  EXPECT_NEAR(more.family.task(1).goal_y, 1, 1e-15);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(more.family.task(3 + k).goal_x, f.family.task(10 + k).goal_x);
  }
  const BuiltFamily<SparsePointFamily> other({}, 8);
  EXPECT_NE(other.family.task(10).goal_x, f.family.task(10).goal_x);
  EXPECT_NEAR(BuiltFamily<SparsePointFamily>({"train_tasks:=1"}).family.task(0).goal_y, 1, 1e-15);
}

TEST(SparsePointFamily, SettingsReachTheTasks) {
  const BuiltFamily<SparsePointFamily> f(
      {"goal_angles:=[0]", "test_goal_angles:=[0.5, 1]", "goal_radius:=1", "horizon:=32"});
  ASSERT_EQ(f.family.numTasks(), 1);
  ASSERT_EQ(f.family.numTestTasks(), 2);
  EXPECT_EQ(f.family.task(2).goal_x, std::cos(1));
  const auto env = f.family.make(0);
  EXPECT_EQ(env->spec().horizon, 32);
  Driven driven(*env);
  driven.reset();
  EXPECT_EQ(driven.step().evaluatedReward(), 0);  // at a distance of 1, inclusive: 1 - 1
  driven.action = {1, 0};
  EXPECT_NEAR(driven.step().evaluatedReward(), 0.1, 1e-15);
}

TEST(SparsePointFamily, RefusesBadSettings) {
  EXPECT_NE(familyError<SparsePointFamily>({"goal_radius:=0"}), "(no error)");
  EXPECT_NE(familyError<SparsePointFamily>({"goal_angles:=[10]"}), "(no error)");
  EXPECT_NE(familyError<SparsePointFamily>({"train_tasks:=0"}), "(no error)");
  EXPECT_NE(familyError<SparsePointFamily>({"horizon:=0"}), "(no error)");
}

}  // namespace
}  // namespace pmeta
