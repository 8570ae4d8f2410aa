#include "pmeta_core/env/mountain_car.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

constexpr double kLeft = 0, kCoast = 1, kRight = 2;

Rng rngOf(std::uint64_t seed) { return Rng(seed, 0, Stream::kMeasure); }

struct After {
  Step step;
  double position;
  double velocity;
};

After after(const MountainCarTask& task, double position, double velocity, double action,
            int steps = 0) {
  MountainCar env(task);
  env.setState({position, velocity, static_cast<double>(steps)});
  Rng rng = rngOf(0);
  After result;
  double seen[2];
  result.step = env.step(&action, rng, seen);
  result.position = seen[0];
  result.velocity = seen[1];
  return result;
}

TEST(MountainCar, SaysWhatAnAgentMustKnow) {
  const MountainCar env({});
  EXPECT_EQ(env.spec().name, "mountain_car");
  EXPECT_EQ(env.spec().observation_size, 2);
  EXPECT_EQ(env.spec().action_size, 1);
  EXPECT_EQ(env.spec().num_actions, 3);
  EXPECT_EQ(env.spec().horizon, 200);
}

TEST(MountainCar, PushesAndSlopesAddUpAndThePositionMovesWithTheNewVelocity) {
  for (const double zeta : {3.0, 3.5, 4.0, 4.5, 5.0}) {
    for (const double action : {kLeft, kCoast, kRight}) {
      const After next = after({zeta, 0.002, 0.003}, -0.5, 0.01, action);
      const double velocity = 0.01 + (action - 1) * 0.002 - 0.003 * std::cos(zeta * 0.5);
      EXPECT_NEAR(next.velocity, velocity, 1e-17);
      EXPECT_NEAR(next.position, -0.5 + velocity, 1e-15);
      EXPECT_EQ(next.step.reward, -1);
    }
  }
  // the valley's bottom, -pi / (2 zeta), holds a car that coasts
  const double bottom = -std::acos(0.0) / 3;
  const After rest = after({3, 0.001, 0.0025}, bottom, 0, kCoast);
  EXPECT_NEAR(rest.position, bottom, 1e-15);
  EXPECT_NEAR(rest.velocity, 0, 1e-18);
}

TEST(MountainCar, SpeedAndTrackAreBounded) {
  EXPECT_EQ(after({}, -0.1, 0.0699, kRight).velocity < 0.07, true);
  EXPECT_EQ(after({}, -1.1, 0.07, kRight).velocity, 0.07);
  EXPECT_EQ(after({}, 0.3, -0.07, kLeft).velocity, -0.07);
  const After right = after({}, 0.59, 0.06, kRight);
  EXPECT_EQ(right.position, 0.6);
  EXPECT_GT(right.velocity, 0);
  // the wall on the left stops the car
  const After left = after({}, -1.19, -0.05, kLeft);
  EXPECT_EQ(left.position, -1.2);
  EXPECT_EQ(left.velocity, 0);
}

TEST(MountainCar, TheGoalTerminatesAndCostsAStepToo) {
  const After there = after({}, 0.49, 0.03, kRight);
  EXPECT_GE(there.position, 0.5);
  EXPECT_TRUE(there.step.terminated);
  EXPECT_FALSE(there.step.truncated);
  EXPECT_EQ(there.step.reward, -1);
  const After before = after({}, 0.45, 0.03, kRight);
  EXPECT_LT(before.position, 0.5);
  EXPECT_FALSE(before.step.terminated);
  const After late = after({}, 0.49, 0.03, kRight, 199);
  EXPECT_TRUE(late.step.terminated);
  EXPECT_FALSE(late.step.truncated);
}

TEST(MountainCar, TheHorizonTruncatesAndDoesNotTerminate) {
  MountainCar env({});
  Rng rng = rngOf(1);
  double seen[2];
  for (int episode = 0; episode < 3; ++episode) {
    env.reset(rng, seen);
    for (int i = 1; i <= 200; ++i) {
      const Step step = env.step(&kCoast, rng, seen);
      ASSERT_FALSE(step.terminated);
      ASSERT_EQ(step.truncated, i == 200) << i;
    }
  }
}

TEST(MountainCar, PushingAlongTheVelocityGetsThere) {
  MountainCar env({});
  Rng rng = rngOf(2);
  double seen[2];
  env.reset(rng, seen);
  int steps = 0;
  Step step;
  while (!step.terminated && !step.truncated) {
    const double action = seen[1] < 0 ? kLeft : kRight;
    step = env.step(&action, rng, seen);
    ++steps;
  }
  EXPECT_TRUE(step.terminated);
  EXPECT_GT(steps, 80);
  EXPECT_LT(steps, 150);
}

TEST(MountainCar, StartsAtRestUniformlyInTheValley) {
  MountainCar env({});
  Rng rng = rngOf(3);
  std::vector<int> counts(10);
  double seen[2];
  for (int i = 0; i < 4000; ++i) {
    env.reset(rng, seen);
    ASSERT_GE(seen[0], -0.6);
    ASSERT_LE(seen[0], -0.4);
    ASSERT_EQ(seen[1], 0);
    ++counts[std::min(9, static_cast<int>((seen[0] + 0.6) * 50))];
  }
  EXPECT_LT(test::chiSquare(counts), 33.7);  // 99.99 %, 9 degrees of freedom
}

TEST(MountainCar, ScalesTheObservedVelocityAndNothingElse) {
  MountainCar plain({}), scaled({}, 15);
  Rng rng = rngOf(4), same = rngOf(4);
  double seen[2], seen_scaled[2];
  plain.reset(rng, seen);
  scaled.reset(same, seen_scaled);
  for (int i = 0; i < 100; ++i) {
    const double action = i % 3;
    plain.step(&action, rng, seen);
    scaled.step(&action, same, seen_scaled);
    ASSERT_EQ(seen_scaled[0], seen[0]);
    ASSERT_EQ(seen_scaled[1], 15 * seen[1]);
    ASSERT_EQ(scaled.state(), plain.state());
  }
  EXPECT_EQ(plain.state(), (std::vector<double>{seen[0], seen[1], 100}));
}

// the family as a program sets it up
struct Family {
  MountainCarFamily family;
  Settings settings;
  explicit Family(const std::vector<std::string>& assignments) {
    family.bind(settings);
    for (const std::string& one : assignments) settings.assign(one);
    family.build(0);
  }
};

TEST(MountainCarFamily, HoldsThePapersTasksByDefault) {
  const Family f({});
  ASSERT_EQ(f.family.numTasks(), 5);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(f.family.task(i).zeta, 3 + 0.5 * i);
    EXPECT_EQ(f.family.task(i).force, 0.001);
    EXPECT_EQ(f.family.task(i).gravity, 0.0025);
    EXPECT_EQ(f.family.taskName(i), "mountain_car_" + std::to_string(i));
  }
  EXPECT_EQ(f.family.taskDescription(1), "zeta 3.5, force 0.001, gravity 0.0025");
}

TEST(MountainCarFamily, SettingsReachTheTasks) {
  const Family f({"zeta:=3", "force:=[0.001, 0.002]", "velocity_scale:=10"});
  ASSERT_EQ(f.family.numTasks(), 2);
  EXPECT_EQ(f.family.task(1).zeta, 3);
  EXPECT_EQ(f.family.task(1).force, 0.002);
  const auto env = f.family.make(1);
  env->setState({-0.5, 0, 0});
  Rng rng = rngOf(5);
  double seen[2];
  env->step(&kRight, rng, seen);
  EXPECT_DOUBLE_EQ(seen[1], 10 * (0.002 - 0.0025 * std::cos(1.5)));
}

TEST(MountainCarFamily, BadSettingsAreRefused) {
  const auto refused = [](const std::vector<std::string>& assignments) {
    return errorOf([&] { Family f(assignments); });
  };
  EXPECT_EQ(refused({"gravity:=0"}),
            "environment.gravity is '0' (given as gravity:=0) but must be a list of numbers, above "
            "0 to 1.");
  EXPECT_NE(refused({"zeta:=[3, -1]"}), "(no error)");
  EXPECT_NE(refused({"velocity_scale:=0"}), "(no error)");
  EXPECT_EQ(refused({"force:=[0.001, 0.002]"}),
            "environment.force has 2 values for 5 tasks: give one, or one for each task.");
}

}  // namespace
}  // namespace pmeta
