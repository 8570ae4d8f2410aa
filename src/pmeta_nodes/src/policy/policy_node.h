#pragma once

#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

#include <cstdint>
#include <memory>
#include <string>

#include "common/health.h"
#include "pmeta_core/run/loaded_policy.h"

namespace pmeta_nodes {

/// A trained policy on ROS: answers each observation with the greedy action.
///
/// Subscribes to observation and publishes action, both std_msgs/Float64MultiArray: as many numbers
/// as the environment's observations have, and one number for a discrete action. An observation of
/// another size, that is not finite or that the policy does not know is warned of and not answered.
/// Only the newest observation counts.
class PolicyNode {
 public:
  /// `task`: for a meta-policy, on which to act; -1: not said. Throws pmeta::Error if `path` is not
  /// a policy file, or of another task's personal policy.
  PolicyNode(const std::string& path, int task);

 private:
  void onObservation(const std_msgs::Float64MultiArray::ConstPtr& msg);
  HealthReport health() const;

  pmeta::LoadedPolicy policy_;
  std_msgs::Float64MultiArray action_;
  std::uint64_t answered_ = 0;
  std::uint64_t refused_ = 0;
  double seconds_ = 0;          ///< of computing, in all
  double longest_seconds_ = 0;  ///< of computing one action

  ros::NodeHandle nh_;
  ros::Publisher action_pub_;
  ros::Subscriber observation_sub_;
  std::unique_ptr<Health> health_;
};

}  // namespace pmeta_nodes
