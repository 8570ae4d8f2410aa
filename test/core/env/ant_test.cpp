#include "pmeta_core/env/ant.h"

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

std::shared_ptr<const MujocoModel> model() {
  static const auto kModel = MujocoModel::open("", Ant::layout());
  return kModel;
}

// positions in Ant::state()
constexpr int kHeight = 2, kQuaternion = 3, kVelocity = 15, kTorso = 15 + 14 + 14;

TEST(Ant, SaysWhatAnAgentMustKnow) {
  const Ant env(0, model());
  EXPECT_EQ(env.spec().name, "ant_fwd_back");
  EXPECT_EQ(env.spec().observation_size, 27);
  EXPECT_EQ(env.spec().action_size, 8);
  EXPECT_EQ(env.spec().num_actions, 0);
  EXPECT_EQ(env.spec().horizon, 200);
}

TEST(Ant, RewardsVelocityAlongADirection) {
  const AntStep step = {2, 3, 0.5, 0.01, 1};
  EXPECT_DOUBLE_EQ(Ant::reward(0, step), 2 - 0.5 - 0.01 + 1);
  EXPECT_DOUBLE_EQ(Ant::reward(kPi, step), -2 - 0.5 - 0.01 + 1);
  EXPECT_DOUBLE_EQ(Ant::reward(kPi / 2, step), 3 - 0.5 - 0.01 + 1);

  Ant env(kPi, model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 10; ++i) {
    const std::vector<double> before = env.state();
    const Step result = driven.randomStep();
    const std::vector<double> after = env.state();
    // positions as the steps left them, not where they ended
    EXPECT_DOUBLE_EQ(env.lastStep().velocity_x, (after[kTorso] - before[kTorso]) / 0.05);
    EXPECT_DOUBLE_EQ(env.lastStep().velocity_y, (after[kTorso + 1] - before[kTorso + 1]) / 0.05);
    double squares = 0;
    for (const double a : driven.action) squares += a * a;
    EXPECT_DOUBLE_EQ(env.lastStep().control_cost, 0.5 * squares);
    EXPECT_EQ(result.reward, Ant::reward(kPi, env.lastStep()));
  }
}

TEST(Ant, ContactsCost) {
  Ant env(0, model());
  Driven driven(env);
  driven.reset();
  double largest = 0;
  for (int i = 0; i < 60; ++i) {
    driven.step();
    ASSERT_GE(env.lastStep().contact_cost, 0);
    ASSERT_LE(env.lastStep().contact_cost, 0.0005 * 84);
    largest = std::max(largest, env.lastStep().contact_cost);
  }
  EXPECT_GT(largest, 0.0005) << "it has not touched the floor";
}

TEST(Ant, TerminatesWhereItsTorsoIsTooLowOrTooHigh) {
  // above a floor that is out of reach: it would push the torso up
  std::string text = shippedModel("ant");
  const std::string floor = "type=\"plane\" pos=\"0 0 0\"";
  text.replace(text.find(floor), floor.size(), "type=\"plane\" pos=\"0 0 -9\"");
  Ant env(0, std::make_shared<const MujocoModel>(MujocoModel::parse(text, "ant")));
  Driven driven(env);
  const auto ends = [&](double height) {
    driven.reset();
    std::vector<double> state = env.state();
    state[kHeight] = height;
    for (int i = 0; i < 14 + 14; ++i) state[kVelocity + i] = 0;
    env.setState(state);
    return driven.step();
  };
  EXPECT_TRUE(ends(0.15).terminated);
  EXPECT_FALSE(ends(0.3).terminated);
  EXPECT_FALSE(ends(0.9).terminated);
  EXPECT_TRUE(ends(1.3).terminated);
  EXPECT_FALSE(ends(1.3).truncated);
  EXPECT_TRUE(std::isfinite(ends(1.3).reward));
}

TEST(Ant, ObservesAllButItsPlaceInThePlane) {
  Ant env(0, model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 5; ++i) driven.randomStep();
  const std::vector<double> state = env.state();
  EXPECT_EQ(driven.observation, std::vector<double>(state.begin() + 2, state.begin() + 29));
}

TEST(Ant, ClipsActionsAllocatesNothingAndRefusesNan) {
  Ant env(0, model());
  test::expectClippedActions(env);
  test::expectNoAllocationInSteps(env);
  Driven driven(env);
  driven.reset();
  driven.action[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(errorOf([&] { driven.step(); }),
            "ant_fwd_back, step 1: action[0] (hip_4) is not finite; the episode cannot go on, "
            "reset it.");
}

TEST(Ant, TheHorizonTruncates) {
  Ant env(0, model(), 5);
  Driven driven(env);
  driven.reset();
  for (int i = 1; i <= 5; ++i) {
    const Step step = driven.step();
    ASSERT_FALSE(step.terminated);
    ASSERT_EQ(step.truncated, i == 5);
  }
}

TEST(Ant, StartsWithNoiseOnTheQuaternionToo) {
  Ant env(0, model());
  Driven driven(env);
  std::vector<double> positions, velocities;
  double tilt = 0;
  for (int i = 0; i < 600; ++i) {
    driven.reset();
    const std::vector<double> state = env.state();
    positions.push_back(state[0]);
    positions.push_back(state[1]);
    positions.push_back(state[kHeight] - 0.75);
    positions.insert(positions.end(), state.begin() + 7, state.begin() + 15);
    velocities.insert(velocities.end(), state.begin() + 15, state.begin() + 29);
    double norm = 0;
    for (int k = 0; k < 4; ++k) norm += state[kQuaternion + k] * state[kQuaternion + k];
    ASSERT_NEAR(norm, 1, 1e-14);
    tilt = std::max(tilt, std::abs(state[kQuaternion + 1]));
    // x and y are free of the others: near the largest noise divided by the norm
    ASSERT_LT(std::abs(state[kQuaternion + 1] / state[kQuaternion]), 0.1 / 0.9);
  }
  test::expectUniform(positions, -0.1, 0.1);
  test::expectNormal(velocities, 0.1);
  EXPECT_GT(tilt, 0.09);
}

TEST(Ant, GoesOnFromASavedStateToTheBit) {
  Ant env(kPi, model());
  Driven driven(env);
  driven.reset();
  for (int i = 0; i < 20; ++i) driven.randomStep();
  const std::vector<double> saved = env.state();
  Ant other(kPi, MujocoModel::open("", Ant::layout()));
  other.setState(saved);
  EXPECT_EQ(other.state(), saved);
  Driven same(other);
  same.rng.setState(driven.rng.state());
  for (int i = 0; i < 60; ++i) {
    const double reward = driven.randomStep().reward;
    ASSERT_EQ(same.randomStep().reward, reward);
    ASSERT_EQ(same.observation, driven.observation);
    ASSERT_EQ(other.state(), env.state());
  }
}

TEST(AntFwdBackFamily, TrainsAndTestsBothDirections) {
  const BuiltFamily<AntFwdBackFamily> f;
  ASSERT_EQ(f.family.numTasks(), 2);
  ASSERT_EQ(f.family.numTestTasks(), 2);
  for (const int test : {0, 2}) {
    EXPECT_EQ(f.family.angle(test), 0);
    EXPECT_EQ(f.family.angle(test + 1), kPi);
    EXPECT_EQ(f.family.taskDescription(test), "run forward");
    EXPECT_EQ(f.family.taskDescription(test + 1), "run backward");
  }
  EXPECT_EQ(f.family.taskName(0), "ant_fwd_back_0");
  EXPECT_EQ(f.family.taskName(3), "ant_fwd_back_test_1");
  EXPECT_EQ(dynamic_cast<Ant&>(*f.family.make(3)).direction(), kPi);

  const BuiltFamily<AntFwdBackFamily> other(
      {"angles:=[0.5, 1, 1.5]", "test_angles:=[]", "horizon:=30"});
  EXPECT_EQ(other.family.numTasks(), 3);
  EXPECT_EQ(other.family.numTestTasks(), 0);
  EXPECT_EQ(other.family.taskDescription(2), "run at an angle of 1.5 rad");
  EXPECT_EQ(other.family.make(0)->spec().horizon, 30);
}

TEST(AntFwdBackFamily, RefusesBadSettings) {
  EXPECT_NE(familyError<AntFwdBackFamily>({"angles:=[7]"}), "(no error)");
  EXPECT_NE(familyError<AntFwdBackFamily>({"angles:=[]"}), "(no error)");
  EXPECT_NE(familyError<AntFwdBackFamily>({"horizon:=0"}), "(no error)");
  // another environment's model
  const test::TempDir dir;
  test::writeFile(dir / "walker.xml", shippedModel("walker2d"));
  EXPECT_EQ(
      familyError<AntFwdBackFamily>({"model_file:=" + (dir / "walker.xml")}),
      "the model " + (dir / "walker.xml") + " has no body 'leg_1': see config/models/ant.xml.");
}

}  // namespace
}  // namespace pmeta
