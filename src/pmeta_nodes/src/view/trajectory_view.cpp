#include "view/trajectory_view.h"

#include <algorithm>
#include <limits>

#include "common/private_param.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;
using pmeta_msgs::Trajectory;

constexpr double kWarnPeriod = 10;  // seconds
constexpr int kPolicies = 2;
constexpr double kLongestPlayStep = 0.5;  // s: a machine that hangs does not skip episodes

}  // namespace

TrajectoryView::TrajectoryView(ros::NodeHandle nh, const pmeta::Experiment& experiment)
    : scene_(makeScene(experiment)) {
  const pmeta::ExperimentSettings& settings = experiment.settings();
  const int num_tasks = experiment.totalTasks();
  content_.experiment = settings.experiment;
  content_.rounds = settings.rounds;
  content_.has_trajectories = settings.publish_trajectories;
  content_.has_personal = !experiment.hasMetaLearner();
  content_.has_meta = experiment.evaluatesMeta();
  content_.tasks.resize(num_tasks);
  playbacks_.assign(num_tasks, Playback(scene_->stepSeconds()));
  personal_returns_.resize(num_tasks);
  meta_returns_.resize(num_tasks);

  frames_.sendTransform(scene_->frames());
  markers_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 1, true);
  subscribe(nh, settings, num_tasks);
  constexpr double kHighestRate = 60;
  redraw_timer_ =
      nh.createWallTimer(ros::WallDuration(1 / privatePositive("redraw_rate", 10, kHighestRate)),
                         &TrajectoryView::redraw, this);
  if (scene_->stepSeconds() == 0) return;

  moving_markers_ = nh.advertise<visualization_msgs::MarkerArray>("playback", 1, true);
  speed_ = privatePositive("speed", 1, 100);
  last_play_ = ros::WallTime::now();
  play_timer_ =
      nh.createWallTimer(ros::WallDuration(1 / privatePositive("frame_rate", 20, kHighestRate)),
                         &TrajectoryView::play, this);
}

void TrajectoryView::subscribe(ros::NodeHandle& nh, const pmeta::ExperimentSettings& settings,
                               int num_tasks) {
  // queues hold one round's messages of both policies; older ones may be dropped
  for (int task = 0; task < num_tasks && settings.publish_trajectories; ++task) {
    subscribers_.push_back(nh.subscribe("task_" + std::to_string(task) + "/trajectory",
                                        2 * kPolicies, &TrajectoryView::onTrajectory, this));
  }
  subscribers_.push_back(
      nh.subscribe("returns", 2 * kPolicies * num_tasks, &TrajectoryView::onReturn, this));
  subscribers_.push_back(nh.subscribe("round", 1, &TrajectoryView::onRound, this));
}

void TrajectoryView::onTrajectory(const Trajectory::ConstPtr& trajectory) {
  if (trajectory->task >= content_.tasks.size()) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a trajectory of task %u: there are tasks 0 to %zu.",
                      trajectory->task, content_.tasks.size() - 1);
    return;
  }
  const std::string problem = scene_->problem(*trajectory);
  if (!problem.empty()) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a trajectory of task %u: %s", trajectory->task,
                      problem.c_str());
    return;
  }
  const TaskView& task = content_.tasks[trajectory->task];
  const bool is_meta = trajectory->policy == Trajectory::META;
  const bool early = content_.summary && content_.summary->run_id == trajectory->run_id &&
                     trajectory->round > content_.summary->round;
  // better an early one than none
  if (early && (is_meta ? task.meta : task.personal).episode) {
    early_episodes_[{trajectory->task, trajectory->policy}] = trajectory;
    return;
  }
  if (playbacks_[trajectory->task].offer(trajectory)) takeShown(trajectory->task);
}

void TrajectoryView::onReturn(const TaskReturn::ConstPtr& result) {
  const bool is_meta = result->policy == TaskReturn::META;
  if (result->task >= content_.tasks.size() ||
      (!is_meta && result->policy != TaskReturn::PERSONAL)) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a return of task %u, policy %u.", result->task,
                      result->policy);
    return;
  }
  (is_meta ? meta_returns_ : personal_returns_)[result->task].take(result);
  showReturns(result->task);
}

void TrajectoryView::onRound(const RoundSummary::ConstPtr& summary) {
  if (!content_.summary || content_.summary->run_id != summary->run_id) {
    forgetOtherRuns(summary->run_id);
  }
  content_.summary = summary;
  for (std::size_t task = 0; task < content_.tasks.size(); ++task) showReturns(task);
  for (auto it = early_episodes_.begin(); it != early_episodes_.end();) {
    const Trajectory::ConstPtr episode = it->second;
    if (episode->round > summary->round) {
      ++it;
      continue;
    }
    it = early_episodes_.erase(it);
    if (playbacks_[episode->task].offer(episode)) takeShown(episode->task);
  }
}

void TrajectoryView::redraw(const ros::WallTimerEvent&) {
  if (!changed_) return;
  changed_ = false;
  markers_.publish(scene_->still(content_));
}

void TrajectoryView::play(const ros::WallTimerEvent&) {
  const ros::WallTime now = ros::WallTime::now();
  const double passed = std::min((now - last_play_).toSec(), kLongestPlayStep);
  last_play_ = now;
  std::vector<double> seconds;
  for (std::size_t task = 0; task < playbacks_.size(); ++task) {
    if (playbacks_[task].advance(speed_ * passed)) takeShown(task);
    seconds.push_back(playbacks_[task].seconds());
  }
  if (moving_markers_.getNumSubscribers() == 0) return;
  moving_markers_.publish(scene_->moving(content_, seconds));
}

void TrajectoryView::showReturns(std::size_t task) {
  const std::uint32_t round =
      content_.summary ? content_.summary->round : std::numeric_limits<std::uint32_t>::max();
  content_.tasks[task].personal.result = personal_returns_[task].upTo(round);
  content_.tasks[task].meta.result = meta_returns_[task].upTo(round);
  changed_ = true;
}

/// Brings the content up to the task's playback.
void TrajectoryView::takeShown(std::size_t task) {
  content_.tasks[task].personal.episode = playbacks_[task].personal();
  content_.tasks[task].meta.episode = playbacks_[task].meta();
  changed_ = true;
}

void TrajectoryView::forgetOtherRuns(const std::string& run_id) {
  for (auto it = early_episodes_.begin(); it != early_episodes_.end();) {
    it = it->second->run_id == run_id ? std::next(it) : early_episodes_.erase(it);
  }
  for (std::size_t task = 0; task < content_.tasks.size(); ++task) {
    playbacks_[task].forgetOtherRuns(run_id);
    takeShown(task);
    personal_returns_[task].forgetOtherRuns(run_id);
    meta_returns_[task].forgetOtherRuns(run_id);
  }
}

}  // namespace pmeta_nodes
