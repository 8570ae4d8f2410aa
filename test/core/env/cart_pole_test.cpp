#include "pmeta_core/env/cart_pole.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

constexpr double kLeft = 0, kRight = 1;
constexpr double kAngleLimit = 0.20943951023931953;

Rng rngOf(std::uint64_t seed) { return Rng(seed, 0, Stream::kMeasure); }

// one step from a state that is given in full
std::vector<double> after(const CartPoleTask& task, const std::vector<double>& state,
                          double action) {
  CartPole env(task);
  env.setState(state);
  Rng rng = rngOf(0);
  std::vector<double> seen(4);
  env.step(&action, rng, seen.data());
  return seen;
}

TEST(CartPole, SaysWhatAnAgentMustKnow) {
  const CartPole env({10, 0.1, 0.5});
  EXPECT_EQ(env.spec().name, "cart_pole");
  EXPECT_EQ(env.spec().observation_size, 4);
  EXPECT_EQ(env.spec().action_size, 1);
  EXPECT_EQ(env.spec().num_actions, 2);
  EXPECT_EQ(env.spec().horizon, 200);
}

// upright and at rest: temp = F / M, so that thetaacc = -(F/M) / (l (4/3 - m/M)) and
// xacc = F/M - m l thetaacc / M
TEST(CartPole, APushFromRestAcceleratesByTheClosedForm) {
  for (const CartPoleTask& task :
       {CartPoleTask{20, 0.1, 0.5}, CartPoleTask{1, 0.1, 0.5}, CartPoleTask{10, 1, 0.5},
        CartPoleTask{10, 0.01, 0.5}, CartPoleTask{10, 0.1, 0.05}}) {
    const double m = task.masspole, l = task.length, total = 1 + m;
    const double turn = -task.force_mag / total / (l * (4.0 / 3 - m / total));
    const double push = task.force_mag / total - m * l * turn / total;
    for (const double action : {kLeft, kRight}) {
      const double sign = action == kRight ? 1 : -1;
      const auto next = after(task, {0, 0, 0, 0, 0, 0}, action);
      EXPECT_EQ(next[0], 0);
      EXPECT_NEAR(next[1], sign * 0.02 * push, 1e-14);
      EXPECT_EQ(next[2], 0);
      EXPECT_NEAR(next[3], sign * 0.02 * turn, 1e-14);
    }
  }
}

// a level pole: cos = 0 and sin = 1 leave theta'' = g / (4/3 l), x'' = (F + m l w^2) / M
TEST(CartPole, ALevelPoleFallsByTheClosedForm) {
  const double w = 3;
  const auto next = after({10, 0.5, 0.25}, {0.1, 0.2, std::acos(0.0), w, 0, 0}, kRight);
  EXPECT_NEAR(next[0], 0.1 + 0.02 * 0.2, 1e-15);
  EXPECT_NEAR(next[1], 0.2 + 0.02 * (10 + 0.125 * w * w) / 1.5, 1e-14);
  EXPECT_NEAR(next[2], std::acos(0.0) + 0.02 * w, 1e-15);
  EXPECT_NEAR(next[3], w + 0.02 * 9.8 / (4.0 / 3 * 0.25), 1e-13);
}

TEST(CartPole, LeftMirrorsRight) {
  const CartPoleTask task{10, 0.1, 0.5};
  Rng rng = rngOf(3);
  for (int i = 0; i < 100; ++i) {
    std::vector<double> state(6, 0.0), mirrored(6, 0.0);
    for (int k = 0; k < 4; ++k) mirrored[k] = -(state[k] = rng.uniform() - 0.5);
    const auto right = after(task, state, kRight), left = after(task, mirrored, kLeft);
    for (int k = 0; k < 4; ++k) EXPECT_EQ(left[k], -right[k]);
  }
}

TEST(CartPole, TerminatesStrictlyBeyondTheLimitsAfterTheStep) {
  const auto terminates = [](const std::vector<double>& state) {
    CartPole env({10, 0.1, 0.5});
    env.setState(state);
    Rng rng = rngOf(0);
    double seen[4];
    const Step step = env.step(&kRight, rng, seen);
    EXPECT_EQ(step.reward, 1);
    EXPECT_FALSE(step.truncated);
    return step.terminated;
  };
  const double up = 1e-9;
  for (const double side : {-1.0, 1.0}) {
    EXPECT_FALSE(terminates({side * 2.4, 0, 0, 0, 0, 0}));
    EXPECT_TRUE(terminates({side * 2.4, side * up, 0, 0, 0, 0}));
    EXPECT_FALSE(terminates({0, 0, side * kAngleLimit, 0, 0, 0}));
    EXPECT_TRUE(terminates({0, 0, side * kAngleLimit, side * up, 0, 0}));
    // what counts is where the step ends
    EXPECT_FALSE(terminates({side * 2.41, -side, 0, 0, 0, 0}));
  }
}

TEST(CartPole, RewardsTheStepThatFallsAndNothingBeyond) {
  CartPole env({10, 0.1, 0.5});
  Rng rng = rngOf(4);
  double seen[4];
  env.reset(rng, seen);
  Step step;
  double total = 0;
  int steps = 0;
  while (!step.terminated) {
    step = env.step(&kRight, rng, seen);
    EXPECT_EQ(step.reward, 1);
    EXPECT_FALSE(step.truncated);
    total += step.reward;
    ASSERT_LT(++steps, 50);
  }
  EXPECT_EQ(total, steps);
  for (int i = 0; i < 3; ++i) {
    step = env.step(&kRight, rng, seen);
    EXPECT_EQ(step.reward, 0);
    EXPECT_TRUE(step.terminated);
  }
  env.reset(rng, seen);
  EXPECT_EQ(env.step(&kRight, rng, seen).reward, 1);
}

// a feedback law that holds the pole up for as long as anyone looks
double balance(const double* s) { return s[2] + 0.3 * s[3] + 0.05 * s[0] + 0.1 * s[1] > 0; }

TEST(CartPole, TheHorizonTruncatesAndDoesNotTerminate) {
  CartPole env({10, 0.1, 0.5});
  Rng rng = rngOf(5);
  double seen[4];
  for (int episode = 0; episode < 5; ++episode) {
    env.reset(rng, seen);
    double total = 0;
    for (int i = 1; i <= 200; ++i) {
      const double action = balance(seen);
      const Step step = env.step(&action, rng, seen);
      total += step.reward;
      ASSERT_FALSE(step.terminated) << i;
      ASSERT_EQ(step.truncated, i == 200) << i;
    }
    EXPECT_EQ(total, 200);
  }
}

TEST(CartPole, AFallOnTheLastStepTerminatesAndDoesNotTruncate) {
  CartPole env({10, 0.1, 0.5});
  env.setState({0, 0, kAngleLimit, 1, 0, 199});
  Rng rng = rngOf(6);
  double seen[4];
  const Step step = env.step(&kRight, rng, seen);
  EXPECT_TRUE(step.terminated);
  EXPECT_FALSE(step.truncated);
}

TEST(CartPole, StartsUniformlyInASmallBox) {
  CartPole env({10, 0.1, 0.5});
  Rng rng = rngOf(7);
  const int n = 4000;
  std::vector<std::vector<int>> counts(4, std::vector<int>(10));
  double seen[4];
  for (int i = 0; i < n; ++i) {
    env.reset(rng, seen);
    for (int k = 0; k < 4; ++k) {
      ASSERT_LE(std::abs(seen[k]), 0.05);
      ++counts[k][std::min(9, static_cast<int>((seen[k] + 0.05) * 100))];
    }
  }
  for (const auto& column : counts) {
    EXPECT_LT(test::chiSquare(column), 33.7);  // 99.99 %, 9 degrees of freedom
  }
}

TEST(CartPole, ObservesItsState) {
  CartPole env({10, 0.1, 0.5});
  Rng rng = rngOf(8);
  double seen[4];
  env.reset(rng, seen);
  EXPECT_EQ(env.state(), (std::vector<double>{seen[0], seen[1], seen[2], seen[3], 0, 0}));
  env.step(&kLeft, rng, seen);
  EXPECT_EQ(env.state(), (std::vector<double>{seen[0], seen[1], seen[2], seen[3], 0, 1}));
  EXPECT_EQ(errorOf([&] {
              env.setState({0, 0, 0, 0, 0.5, 0});
            }),
            "a state of cart_pole has fallen = 0.5, which must be 0 or 1.");
}

// the family as a program sets it up
struct Family {
  CartPoleFamily family;
  Settings settings;
  explicit Family(const std::vector<std::string>& assignments) {
    family.bind(settings);
    for (const std::string& one : assignments) settings.assign(one);
    family.build(0);
  }
};

TEST(CartPoleFamily, HoldsThePapersTasksByDefault) {
  const Family f({});
  const double expected[5][3] = {
      {20, 0.1, 0.5}, {1, 0.1, 0.5}, {10, 1, 0.5}, {10, 0.01, 0.5}, {10, 0.1, 0.05}};
  ASSERT_EQ(f.family.numTasks(), 5);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(f.family.task(i).force_mag, expected[i][0]);
    EXPECT_EQ(f.family.task(i).masspole, expected[i][1]);
    EXPECT_EQ(f.family.task(i).length, expected[i][2]);
    EXPECT_EQ(f.family.taskName(i), "cart_pole_" + std::to_string(i));
    EXPECT_EQ(f.family.make(i)->spec().name, "cart_pole");
  }
  EXPECT_EQ(f.family.taskDescription(3), "force 10 N, pole of 0.01 kg, half length 0.5 m");
}

TEST(CartPoleFamily, OneValueHoldsForAllTasks) {
  const Family f({"force_mag:=5", "masspole:=[0.1, 0.2, 0.3]", "length:=1"});
  ASSERT_EQ(f.family.numTasks(), 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(f.family.task(i).force_mag, 5);
    EXPECT_DOUBLE_EQ(f.family.task(i).masspole, 0.1 * (i + 1));
    EXPECT_EQ(f.family.task(i).length, 1);
  }
  EXPECT_EQ(Family({"force_mag:=5", "masspole:=1", "length:=1"}).family.numTasks(), 1);
}

TEST(CartPoleFamily, BadSettingsAreRefused) {
  const auto refused = [](const std::vector<std::string>& assignments) {
    return errorOf([&] { Family f(assignments); });
  };
  EXPECT_EQ(refused({"length:=[0.5, 0]"}),
            "environment.length is '[0.5, 0]' (given as length:=[0.5, 0]) but must be a list of "
            "numbers, from 0.001 to 1000.");
  EXPECT_NE(refused({"masspole:=-1"}), "(no error)");
  EXPECT_NE(refused({"force_mag:=strong"}), "(no error)");
  EXPECT_EQ(refused({"force_mag:=[1, 2]"}),
            "environment.force_mag has 2 values for 5 tasks: give one, or one for each task.");
  EXPECT_EQ(refused({"force_mag:=[1, 2, 3, 4, 5, 6]"}),
            "environment.masspole has 5 values for 6 tasks: give one, or one for each task.");
}

}  // namespace
}  // namespace pmeta
