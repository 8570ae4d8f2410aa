#pragma once

#include <ros/ros.h>

#include <functional>
#include <string>
#include <vector>

#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>

#include "pmeta_core/run/finished_run.h"

namespace pmeta_nodes {

/// Publishes what the policies of a finished run do, for those who look on: task_I/trajectory,
/// returns and round, as agents and aggregator would. Whoever comes late gets all of it.
class ShowRun {
 public:
  /// `run` must outlive it.
  ShowRun(ros::NodeHandle nh, const pmeta::FinishedRun& run);

  /// Evaluates the policies of one task after the other, and publishes as it goes. `pause` is
  /// called in between; false ends it.
  void evaluate(const std::function<bool()>& pause);

 private:
  void advertise(ros::NodeHandle& nh);
  void show(const pmeta::ShownPolicy& shown);
  void summarise();

  const pmeta::FinishedRun& run_;
  std::vector<ros::Publisher> trajectory_pubs_;  // by task
  ros::Publisher return_pub_;
  ros::Publisher round_pub_;
  // so far
  std::vector<pmeta_msgs::Trajectory> trajectories_;
  std::vector<pmeta_msgs::TaskReturn> returns_;
};

}  // namespace pmeta_nodes
