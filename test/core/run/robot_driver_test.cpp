// What a robot is commanded, period by period: names, ages, limits, and when it is the safe action.
#include "pmeta_core/run/robot_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "../support.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::TempDir;
using testing::HasSubstr;

constexpr double kPeriod = 0.04;  // of the arm

// a policy of the arm, of three joints, that nobody trained
class RobotDriverTest : public ::testing::Test {
 protected:
  RobotDriverTest()
      : experiment_(Experiment::load(PMETA_TEST_DATA "/../../examples/arm/arm.yaml",
                                     {"task_encoding:=none"})),
        file_(dir_.path() + "/policy.safetensors") {
    Model model = experiment_.initialModel();
    for (float& x : model.floats()) x *= 3;  // large actions
    savePolicy(file_, model, policyMetadata(experiment_, {PolicyKind::kPersonal, 0, 7}));
    settings_.single_inputs = {"turn_control", "shoulder_control", "elbow_control",
                               "reach_x",      "reach_y",          "reach_z",
                               "to_reach_x",   "to_reach_y",       "to_reach_z"};
  }

  // armed, with all inputs taken at `now`
  std::unique_ptr<RobotDriver> ready(double now = 0) {
    auto driver = std::make_unique<RobotDriver>(file_, -1, settings_);
    driver->arm();
    give(*driver, now);
    return driver;
  }

  void give(RobotDriver& driver, double now) {
    driver.take(joints_, now);
    giveSingle(driver, now);
  }

  void giveSingle(RobotDriver& driver, double now) {
    double value = 0.1;
    for (const std::string& name : settings_.single_inputs) driver.take(name, value += 0.1, now);
  }

  TempDir dir_;
  Experiment experiment_;
  std::string file_;
  DriverSettings settings_;
  JointReadings joints_{{"turn", "shoulder", "elbow"}, {0.1, 0.2, 0.3}, {1, 2, 3}, {}};
};

TEST_F(RobotDriverTest, ActsAsThePolicyByTheNamesOfWhatIsMeasured) {
  const auto armed = ready();
  RobotDriver& driver = *armed;
  EXPECT_EQ(driver.period(), kPeriod);
  EXPECT_EQ(driver.outputs(), (std::vector<std::string>{"turn", "shoulder", "elbow"}));
  LoadedPolicy policy(file_);
  std::vector<double> observation = {0.1, 0.2, 0.3, 1, 2, 3}, action(3);
  // in the order of the policy file, given in the order of the alphabet
  const std::vector<std::string> sorted(settings_.single_inputs.begin(),
                                        settings_.single_inputs.end());
  for (std::size_t i = 6; i < 15; ++i) {
    const std::string name = policy.spec().observation[i].name;
    const auto place = std::find(sorted.begin(), sorted.end(), name) - sorted.begin();
    observation.push_back(0.1 + 0.1 * static_cast<double>(place + 1));
  }
  ASSERT_TRUE(policy.act(observation.data(), action.data()));
  const std::vector<double>& command = driver.command(0);
  EXPECT_EQ(driver.reason(), "");
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(command[k], action[k], 1e-6);
}

TEST_F(RobotDriverTest, JointsComeInAnyOrder) {
  const std::vector<double> command = ready()->command(0);
  joints_ = {{"elbow", "turn", "shoulder"}, {0.3, 0.1, 0.2}, {3, 1, 2}, {}};
  EXPECT_EQ(ready()->command(0), command);
  settings_.ignored_joints = {"finger"};
  joints_ = {{"elbow", "finger", "turn", "shoulder"}, {0.3, 9, 0.1, 0.2}, {3, 9, 1, 2}, {}};
  EXPECT_EQ(ready()->command(0), command);
}

TEST_F(RobotDriverTest, ActuatorsAreCommandedInTheOrderAskedFor) {
  const std::vector<double> command = ready()->command(0);
  settings_.actuators = {"elbow", "turn", "shoulder"};
  EXPECT_EQ(ready()->command(0), (std::vector<double>{command[2], command[0], command[1]}));
}

TEST_F(RobotDriverTest, JointsThatAreMissingOrUnknownAreRefusedByName) {
  const auto armed = ready();
  RobotDriver& driver = *armed;
  driver.command(0);
  ASSERT_EQ(driver.reason(), "");
  joints_.names[1] = "shuolder";
  EXPECT_EQ(errorOf([&] { give(driver, 0); }),
            "joint 'shuolder' is unknown: the policy observes nothing of it; leave it out, or name "
            "it in ignored_joints.");
  EXPECT_EQ(driver.command(0.01), std::vector<double>(3));
  EXPECT_THAT(driver.reason(), HasSubstr("'shuolder'"));
  joints_ = {{"turn", "elbow"}, {0, 0}, {0, 0}, {}};
  EXPECT_EQ(errorOf([&] { give(driver, 0); }),
            "no joint measures 'shoulder', which the policy observes; if it comes on its own, name "
            "it in single_inputs.");
  joints_ = {{"turn", "turn", "shoulder", "elbow"}, {0, 0, 0, 0}, {0, 0, 0, 0}, {}};
  EXPECT_EQ(errorOf([&] { give(driver, 0); }), "joint 'turn' is measured twice.");
  joints_ = {{"turn", "shoulder", "elbow"}, {0, 0, 0}, {}, {}};
  EXPECT_EQ(errorOf([&] { give(driver, 0); }),
            "the input of 'turn_velocity' is missing or not finite.");
  joints_.velocities = {0, std::nan(""), 0};
  EXPECT_EQ(errorOf([&] { give(driver, 0); }),
            "the input of 'shoulder_velocity' is missing or not finite.");
  joints_.velocities = {0, 0, 0};
  give(driver, 0.01);
  driver.command(0.02);
  EXPECT_EQ(driver.reason(), "") << "good ones make it act again";
}

TEST_F(RobotDriverTest, StartsDisarmed) {
  settings_.safe_action = {{"elbow", 0.25}};
  RobotDriver driver(file_, -1, settings_);
  give(driver, 0);
  const std::vector<double> safe = {0, 0, 0.25};
  EXPECT_EQ(driver.command(0), safe);
  EXPECT_EQ(driver.reason(), "disarmed");
  driver.arm();
  EXPECT_NE(driver.command(0.01), safe);
  driver.disarm();
  EXPECT_EQ(driver.command(0.02), safe);
}

TEST_F(RobotDriverTest, AStaleInputMeansTheSafeActionUntilItIsFresh) {
  const auto armed = ready(10);
  RobotDriver& driver = *armed;
  EXPECT_EQ(driver.inputTimeout(), 2 * kPeriod);
  driver.command(10 + 1.9 * kPeriod);
  EXPECT_EQ(driver.reason(), "");
  giveSingle(driver, 10 + 1.9 * kPeriod);  // the joints fall silent
  EXPECT_EQ(driver.command(10.1), std::vector<double>(3));
  EXPECT_THAT(driver.reason(), HasSubstr("the input of 'turn' is 0.1 s old, more than 0.08"));
  give(driver, 10.1);
  driver.command(10.1);
  EXPECT_EQ(driver.reason(), "");
  EXPECT_EQ(errorOf([&] { driver.take("reach_y", std::nan(""), 10.1); }),
            "the input of 'reach_y' is not finite.");
  driver.command(10.1);
  EXPECT_EQ(driver.reason(), "there is no input of 'reach_y'.");
}

TEST_F(RobotDriverTest, SlewLimitsTheWayToAnActionButNotToTheSafeOne) {
  const std::vector<double> whole = ready()->command(0);
  ASSERT_GT(std::abs(whole[0]), 0.1);
  settings_.slew = 0.5;
  const auto armed = ready();
  RobotDriver& driver = *armed;
  const double first = driver.command(0)[0];
  EXPECT_NEAR(std::abs(first), 0.5 * kPeriod, 1e-12);
  EXPECT_NEAR(std::abs(driver.command(0.06)[0]), std::abs(first) + 0.5 * 0.06, 1e-12);
  driver.disarm();
  EXPECT_EQ(driver.command(0.07), std::vector<double>(3));
}

TEST_F(RobotDriverTest, SettingsThatCannotBeAreRefused) {
  const auto refusal = [&](const std::function<void(DriverSettings&)>& change) {
    DriverSettings settings = settings_;
    change(settings);
    return errorOf([&] { RobotDriver(file_, -1, settings); });
  };
  EXPECT_EQ(refusal([](auto& s) {
              s.safe_action = {{"elbow", 1.5}};
            }),
            "the safe action of 'elbow' is 1.5 but must be from -1 to 1.");
  EXPECT_EQ(refusal([](auto& s) {
              s.safe_action = {{"finger", 0}};
            }),
            "safe_action names 'finger', but the policy has no such action: it has turn, shoulder, "
            "elbow.");
  EXPECT_THAT(refusal([](auto& s) { s.single_inputs = {"force"}; }),
              HasSubstr("single_inputs names 'force'"));
  EXPECT_EQ(refusal([](auto& s) {
              s.actuators = {"turn", "turn", "elbow"};
            }),
            "actuators must name each of the policy's actions once: turn, shoulder, elbow.");
  EXPECT_EQ(refusal([](auto& s) { s.rate = -1; }), "rate is -1 but must be at least 0.");
  EXPECT_NE(refusal([](auto& s) { s.slew = std::nan(""); }), "(no error)");
}

}  // namespace
}  // namespace pmeta
