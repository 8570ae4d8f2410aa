// A robot driven over ROS by the shipped policy of the point robot's task 3: see drive_robot.test.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/SetBool.h>

#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/run/loaded_policy.h"

namespace pmeta_nodes {
namespace {

const std::vector<double> kSafe = {0, 0.25};  // y, then x

class DriveRobotTest : public ::testing::Test {
 protected:
  // the robot's joints, if it is to measure any, until `condition` holds; false after `seconds`
  template <class Condition>
  bool measureUntil(const std::optional<sensor_msgs::JointState>& joints,
                    const Condition& condition, double seconds = 15) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(seconds);
    while (!condition()) {
      if (ros::WallTime::now() > limit) return false;
      if (joints) joints_pub_.publish(*joints);
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.01));
    }
    return true;
  }

  static sensor_msgs::JointState at(double x, double y) {
    sensor_msgs::JointState joints;
    joints.name = {"y", "x"};
    joints.position = {y, x};
    return joints;
  }

  void arm(bool on) {
    std_srvs::SetBool call;
    call.request.data = on ? 1 : 0;
    ASSERT_TRUE(ros::service::waitForService("robot/arm", 15000));
    ASSERT_TRUE(ros::service::call("robot/arm", call));
    EXPECT_EQ(call.response.message, on ? "armed" : "disarmed");
  }

  std::vector<double> expected(double x, double y) {
    const double observation[] = {x, y};
    std::vector<double> action(2);
    EXPECT_TRUE(policy_.act(observation, action.data()));
    return {action[1], action[0]};
  }

  bool commands(const std::vector<double>& command) const { return command_.data == command; }

  void onDiagnostics(const diagnostic_msgs::DiagnosticArray::ConstPtr& msg) {
    for (const auto& status : msg->status) said_ = status.message;
  }

  static std::string policyFile() {
    std::string file;
    ros::param::get("/robot/driver/policy", file);
    return file;
  }

  pmeta::LoadedPolicy policy_{policyFile()};
  ros::NodeHandle nh_;
  std_msgs::Float64MultiArray command_;
  std::string said_;  // of its health
  ros::Publisher joints_pub_ = nh_.advertise<sensor_msgs::JointState>("robot/joint_states", 1);
  ros::Subscriber command_sub_ = nh_.subscribe<std_msgs::Float64MultiArray>(
      "robot/command", 1,
      [this](const std_msgs::Float64MultiArray::ConstPtr& msg) { command_ = *msg; });
  ros::Subscriber diagnostics_sub_ =
      nh_.subscribe("/diagnostics", 8, &DriveRobotTest::onDiagnostics, this);
};

TEST_F(DriveRobotTest, ActsWhileItIsArmedAndItsInputsAreFresh) {
  ASSERT_TRUE(measureUntil(at(0.1, 0.2), [&] { return commands(kSafe); })) << "disarmed at first";
  ASSERT_EQ(command_.layout.dim.size(), 2u);
  EXPECT_EQ(command_.layout.dim[0].label, "move_y");

  arm(true);
  const std::vector<double> here = expected(0.1, 0.2);
  EXPECT_TRUE(measureUntil(at(0.1, 0.2), [&] { return commands(here); }));
  const std::vector<double> there = expected(-0.4, 0.6);
  ASSERT_NE(here, there);
  EXPECT_TRUE(measureUntil(at(-0.4, 0.6), [&] { return commands(there); }));

  EXPECT_TRUE(measureUntil(std::nullopt, [&] { return commands(kSafe); })) << "silence";
  const auto says = [&](const char* word) {
    return [this, word] { return said_.find(word) != std::string::npos; };
  };
  EXPECT_TRUE(measureUntil(std::nullopt, says("s old, more than 0.4"))) << said_;
  sensor_msgs::JointState strange = at(0.1, 0.2);
  strange.name[0] = "z";
  EXPECT_TRUE(measureUntil(strange, says("joint 'z' is unknown"))) << said_;
  EXPECT_TRUE(commands(kSafe));
  EXPECT_TRUE(measureUntil(at(0.1, 0.2), [&] { return commands(here); })) << "all is well again";
  arm(false);
  EXPECT_TRUE(measureUntil(at(0.1, 0.2), [&] { return commands(kSafe); }));
}

}  // namespace
}  // namespace pmeta_nodes

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "drive_robot_test");
  const ros::NodeHandle keep_ros_running;
  return RUN_ALL_TESTS();
}
