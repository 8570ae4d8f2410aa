#include "pmeta_core/mjcf/mjcf_env.h"

#include <gtest/gtest.h>

#include <mujoco/mujoco.h>

#include <cmath>
#include <limits>

#include "pmeta_core/env/mujoco_kinematics.h"
#include "small_robot.h"

namespace pmeta {
namespace {

using test::Driven;
using test::errorOf;
using test::smallRobot;
using test::TempDir;

class MjcfEnvTest : public ::testing::Test {
 protected:
  const TempDir dir_;
  const Experiment experiment_ = smallRobot(dir_);
  const std::unique_ptr<Env> env_ = experiment_.family().make(0);
  Driven driven_{*env_};

  const MjcfEnv& env() const { return dynamic_cast<const MjcfEnv&>(*env_); }
  const mjData* data() const { return env().simulation().data(); }

  // the number of that name in the observation
  double seen(const std::string& name) const {
    for (std::size_t i = 0; i < driven_.observation.size(); ++i) {
      if (env_->spec().observation[i].name == name) return driven_.observation[i];
    }
    ADD_FAILURE() << "nothing is called " << name;
    return 0;
  }
};

TEST_F(MjcfEnvTest, DescribesItsNumbers) {
  const EnvSpec& spec = env_->spec();
  EXPECT_EQ(spec.name, "mjcf");
  EXPECT_EQ(spec.observation_size, 9 + 2 + 2 + 3 + 3 + 3 + 6 + 2 + 3);
  EXPECT_EQ(spec.action_size, 3);
  EXPECT_DOUBLE_EQ(spec.step_seconds, 0.01);
  EXPECT_TRUE(spec.restorable);
  std::vector<std::string> names;
  for (const Quantity& one : observationsOf(spec)) {
    names.push_back(one.name + (one.unit.empty() ? "" : " " + one.unit));
  }
  EXPECT_EQ(names, (std::vector<std::string>{"root_x m",
                                             "root_y m",
                                             "root_z m",
                                             "root_qw",
                                             "root_qx",
                                             "root_qy",
                                             "root_qz",
                                             "shoulder rad",
                                             "elbow rad",
                                             "shoulder_velocity rad/s",
                                             "root_vz m/s",
                                             "tip_x m",
                                             "tip_z m",
                                             "turning_0 rad/s",
                                             "turning_1 rad/s",
                                             "turning_2 rad/s",
                                             "reach_x m",
                                             "reach_y m",
                                             "reach_z m",
                                             "to_reach_x m",
                                             "to_reach_y m",
                                             "to_reach_z m",
                                             "lower_contact_torque_x N m",
                                             "lower_contact_torque_y N m",
                                             "lower_contact_torque_z N m",
                                             "lower_contact_force_x N",
                                             "lower_contact_force_y N",
                                             "lower_contact_force_z N",
                                             "shoulder_control",
                                             "elbow_control",
                                             "last_shoulder",
                                             "last_elbow",
                                             "last_root_vz_force"}));
  EXPECT_EQ(spec.observation[9].high, 3) << "as it is clipped";
  EXPECT_EQ(spec.observation[3].low, -1) << "of a quaternion";
  EXPECT_EQ(spec.action[0].name, "shoulder");
  EXPECT_EQ(spec.action[2].name, "root_vz_force");
}

TEST_F(MjcfEnvTest, ScalesActionsToWhatTheyDrive) {
  driven_.reset();
  EXPECT_EQ(data()->ctrl[1], 0.5) << "of the keyframe";
  EXPECT_EQ(data()->ctrl[0], seen("shoulder")) << "is held";
  driven_.action = {1, 0, -0.5};
  driven_.step();
  EXPECT_EQ(data()->ctrl[0], 4);
  EXPECT_EQ(seen("shoulder_control"), 4);
  EXPECT_EQ(seen("last_root_vz_force"), -0.5);
  EXPECT_EQ(data()->qfrc_applied[2], -15);
  driven_.action = {-7, -0.5, 0};
  driven_.step();
  EXPECT_EQ(data()->ctrl[0], -2);
  EXPECT_NEAR(data()->ctrl[1], 0.45, 1e-15) << "10 per s, half of it for 0.01 s";
  driven_.action = {0, 1, 0};
  for (int i = 0; i < 3; ++i) driven_.step();
  EXPECT_EQ(data()->ctrl[0], 1);
  EXPECT_EQ(data()->ctrl[1], 0.5) << "its limit";
  driven_.action[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(
      errorOf([&] { driven_.step(); }),
      "mjcf, step 6: action[2] (root_vz_force) is not finite; the episode cannot go on, reset "
      "it.");
}

TEST_F(MjcfEnvTest, ObservesWhereTheStepEnded) {
  driven_.reset();
  for (int i = 0; i < 10; ++i) driven_.randomStep();
  MujocoKinematics kinematics(*env_->model());
  const std::vector<double> configuration = env_->configuration();
  ASSERT_EQ(configuration.size(), static_cast<std::size_t>(kinematics.nq()));
  kinematics.pose(configuration.data());
  const int lower = env_->model()->body("lower");
  const double* at = kinematics.bodyPosition(lower);
  EXPECT_NEAR(at[0], data()->xpos[3 * lower], 1e-15);
  EXPECT_EQ(seen("root_z"), configuration[2]);
  EXPECT_NEAR(seen("to_reach_x"), seen("reach_x") - seen("tip_x"), 1e-15);
  // the target is put where the goal is, and drawn there
  EXPECT_EQ(configuration[9], seen("reach_x"));
  EXPECT_EQ(configuration[11], seen("reach_z"));
  EXPECT_EQ(kinematics.bodyPosition(env_->model()->body("target"))[2], seen("reach_z"));
}

TEST_F(MjcfEnvTest, DrawsAGoalForEachEpisode) {
  std::set<double> drawn;
  for (int i = 0; i < 200; ++i) {
    driven_.reset();
    const double radius = std::hypot(seen("reach_x"), seen("reach_z") - 0.6);
    EXPECT_GE(radius, 0.1 - 1e-12);
    EXPECT_LE(radius, 0.3 + 1e-12);
    EXPECT_EQ(seen("reach_y"), 0);
    drawn.insert(seen("reach_x"));
  }
  EXPECT_EQ(drawn.size(), 200u);
}

TEST_F(MjcfEnvTest, RewardsAndIsJudgedByWhatItsTermsSay) {
  driven_.reset();
  const auto distance = [&] {
    return std::hypot(seen("to_reach_x"), seen("to_reach_y"), seen("to_reach_z"));
  };
  for (int i = 0; i < 20; ++i) {
    const double before = distance();
    const Step step = driven_.randomStep();
    double cost = 0;
    for (const double a : driven_.action) cost += a * a;
    const double there = distance() <= 0.1 ? 1 : 0;
    EXPECT_NEAR(step.reward, 2 * (before - distance()) / 0.01 - 0.1 * cost, 1e-10);
    ASSERT_TRUE(step.sparse_reward.has_value());
    EXPECT_NEAR(*step.sparse_reward, 2 * (before - distance()) / 0.01 - 0.1 * cost + there, 1e-10);
    if (step.terminated) break;
  }
}

TEST_F(MjcfEnvTest, EndsWhereATerminationSaysSo) {
  driven_.reset();
  driven_.action = {0, 0, -1};
  Step step;
  int steps = 0;
  while (!step.terminated && !step.truncated) {
    ASSERT_GE(data()->xpos[3 * env_->model()->body("base") + 2], 0.3);
    step = driven_.step();
    ++steps;
  }
  EXPECT_TRUE(step.terminated);
  EXPECT_LT(steps, 200);
}

TEST_F(MjcfEnvTest, GoesOnFromItsStateToTheBit) {
  driven_.reset();
  for (int i = 0; i < 7; ++i) driven_.randomStep();
  // another process has read the same files
  const Experiment again = smallRobot(dir_);
  const auto other = again.family().make(0);
  other->setState(env_->state());
  EXPECT_EQ(other->state(), env_->state());
  Driven same(*other);
  same.rng.setState(driven_.rng.state());
  for (int i = 0; i < 30; ++i) {
    const Step a = driven_.randomStep();
    const Step b = same.randomStep();
    ASSERT_EQ(driven_.observation, same.observation);
    ASSERT_EQ(a.reward, b.reward);
    ASSERT_EQ(a.terminated, b.terminated);
    ASSERT_EQ(env_->state(), other->state());
    if (a.terminated) break;
  }
  EXPECT_NE(errorOf([&] { env_->setState({1}); }), "(no error)");
}

TEST_F(MjcfEnvTest, ClipsActionsAndAllocatesNothing) {
  test::expectClippedActions(*env_);
  test::expectNoAllocationInSteps(*env_);
}

}  // namespace
}  // namespace pmeta
