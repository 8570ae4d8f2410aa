#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "common/recent_returns.h"
#include "pmeta_nodes/scene.h"
#include "view/playback.h"

namespace pmeta_nodes {

/// Draws the last episode of both policies on every task for rviz.
///
/// Subscribes task_I/trajectory, returns and round; publishes static frames, markers (what stands
/// still) and playback (what moves), both latched and each message whole. All is shown as of the
/// last complete round, which agents are ahead of. Only looks on: short
/// queues, at most ~redraw_rate pictures a second of what stands still, and nothing that moves is
/// worked out while nobody watches. Callbacks must come from one thread at a time.
class TrajectoryView {
 public:
  /// `experiment` must outlive the view.
  TrajectoryView(ros::NodeHandle nh, const pmeta::Experiment& experiment);

 private:
  void subscribe(ros::NodeHandle& nh, const pmeta::ExperimentSettings& settings, int num_tasks);
  void onTrajectory(const pmeta_msgs::Trajectory::ConstPtr& trajectory);
  void onReturn(const pmeta_msgs::TaskReturn::ConstPtr& result);
  void onRound(const pmeta_msgs::RoundSummary::ConstPtr& summary);
  void redraw(const ros::WallTimerEvent& event);
  void play(const ros::WallTimerEvent& event);

  void showReturns(std::size_t task);
  void takeShown(std::size_t task);
  void forgetOtherRuns(const std::string& run_id);

  std::unique_ptr<Scene> scene_;
  SceneContent content_;
  std::vector<Playback> playbacks_;  // one for each task, as are the two below
  std::vector<RecentReturns> personal_returns_;
  std::vector<RecentReturns> meta_returns_;
  // by task and policy: of a round that is not complete yet
  std::map<std::pair<std::uint32_t, int>, pmeta_msgs::Trajectory::ConstPtr> early_episodes_;
  double speed_ = 1;
  bool changed_ = true;  // since the last picture

  std::vector<ros::Subscriber> subscribers_;
  ros::Publisher markers_;
  ros::Publisher moving_markers_;
  tf2_ros::StaticTransformBroadcaster frames_;
  ros::WallTimer redraw_timer_;
  ros::WallTimer play_timer_;
  ros::WallTime last_play_;
};

}  // namespace pmeta_nodes
