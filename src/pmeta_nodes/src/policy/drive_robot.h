#pragma once

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/health.h"
#include "pmeta_core/run/robot_driver.h"

namespace pmeta_nodes {

/// Drives a robot with a trained policy, at a fixed rate: a pmeta::RobotDriver on ROS.
///
/// Subscribes to joint_states (sensor_msgs/JointState) and, for each observation that comes on its
/// own, to input/NAME (std_msgs/Float64); where the policy observes rewards, to reward
/// (std_msgs/Float64). Publishes command (std_msgs/Float64MultiArray), whose layout names its
/// numbers. The service arm (std_srvs/SetBool) lets the policy act, or not; begin_episode
/// (std_srvs/Trigger) ends an episode of a policy that explores or remembers.
class DriveRobot {
 public:
  /// `driver` must outlive it.
  DriveRobot(pmeta::RobotDriver& driver, const std::vector<std::string>& single_inputs);
  /// Commands the safe action once more.
  ~DriveRobot();

 private:
  void onJoints(const sensor_msgs::JointState& joints);
  bool onArm(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool onBeginEpisode(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void onTimer(const ros::SteadyTimerEvent& event);
  void publishCommand();
  template <class Take>
  void taken(const Take& take);
  HealthReport health() const;

  pmeta::RobotDriver& driver_;
  std_msgs::Float64MultiArray command_;
  std::uint64_t commands_ = 0, acted_ = 0, late_ = 0, refused_ = 0;

  ros::NodeHandle nh_;
  ros::Publisher command_pub_;
  ros::Subscriber joints_sub_;
  std::vector<ros::Subscriber> input_subs_;
  std::vector<ros::ServiceServer> services_;
  ros::SteadyTimer timer_;
  std::unique_ptr<Health> health_;
};

}  // namespace pmeta_nodes
