#pragma once

#include <string>
#include <vector>

#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "gridworld_scene.h"
#include "pmeta_core/run/experiment.h"

namespace pmeta_nodes {

/// Draws the last episode of both policies on every task for rviz.
///
/// Subscribes task_<i>/trajectory, returns and round; publishes markers (latched, the whole scene)
/// and static frames. Only looks on: short queues, and at most ~redraw_rate pictures a second.
/// Callbacks must come from one thread at a time.
class TrajectoryView {
 public:
  TrajectoryView(ros::NodeHandle nh, ros::NodeHandle private_nh,
                 const pmeta::Experiment& experiment);

 private:
  void onTrajectory(const pmeta_msgs::Trajectory::ConstPtr& trajectory);
  void onReturn(const pmeta_msgs::TaskReturn::ConstPtr& result);
  void onRound(const pmeta_msgs::RoundSummary::ConstPtr& summary);
  void redraw(const ros::WallTimerEvent& event);

  PolicyView& view(int task, bool is_meta);
  void forgetOtherRuns(const std::string& run_id);

  std::vector<GridGeometry> grids_;
  SceneContent content_;
  bool changed_ = true;  ///< since the last picture

  std::vector<ros::Subscriber> subscribers_;
  ros::Publisher markers_;
  tf2_ros::StaticTransformBroadcaster frames_;
  ros::WallTimer timer_;
};

}  // namespace pmeta_nodes
