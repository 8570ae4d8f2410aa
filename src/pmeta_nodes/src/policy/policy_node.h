#pragma once

#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/Trigger.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/health.h"
#include "pmeta_core/run/loaded_policy.h"

namespace pmeta_nodes {

/// A trained policy on ROS: answers each observation with the greedy action.
///
/// Subscribes to observation and publishes action, both std_msgs/Float64MultiArray: as many numbers
/// as the environment's observations have, and one number for a discrete action. An observation of
/// another size, that is not finite or that the policy does not know is warned of and not answered.
/// Only the newest observation counts.
///
/// A meta-policy that finds out its task explores it first. It then also subscribes to reward
/// (std_msgs/Float64), of each action, which may come before or after the observation that the
/// action led to: the next action waits for both. The service begin_episode (std_srvs/Trigger) ends
/// an episode and begins the next; after its exploration episodes the policy acts greedily by what
/// it has found out.
class PolicyNode {
 public:
  /// `task`: for a meta-policy, on which to act; -1: not said. `explores`: a meta-policy may find
  /// that out, with draws by `seed`. Throws pmeta::Error if `path` is not a policy file, or of
  /// another task's personal policy.
  PolicyNode(const std::string& path, int task, bool explores, std::uint64_t seed);

 private:
  void onObservation(const std_msgs::Float64MultiArray::ConstPtr& msg);
  void onReward(const std_msgs::Float64::ConstPtr& msg);
  bool onBeginEpisode(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void answer(const std::vector<double>& observation);
  void goOn();
  void forgetOutcome();
  void refuse(const std::string& what);
  std::string doing() const;
  HealthReport health() const;

  pmeta::LoadedPolicy policy_;
  std_msgs::Float64MultiArray action_;
  std::uint64_t answered_ = 0;
  std::uint64_t refused_ = 0;
  double seconds_ = 0;          ///< of computing, in all
  double longest_seconds_ = 0;  ///< of computing one action
  // what came of the last action, as far as it is known; only where the policy must observe it
  bool awaits_ = false;
  std::optional<double> reward_;
  std::optional<std::vector<double>> next_observation_;

  ros::NodeHandle nh_;
  ros::Publisher action_pub_;
  ros::Subscriber observation_sub_;
  ros::Subscriber reward_sub_;
  ros::ServiceServer begin_episode_;
  std::unique_ptr<Health> health_;
};

}  // namespace pmeta_nodes
