#include "trajectory_view.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;
using pmeta_msgs::Trajectory;

constexpr double kWarnPeriod = 10;  // seconds
constexpr int kPolicies = 2;

double redrawRate(const ros::NodeHandle& private_nh) {
  constexpr double kDefault = 10;
  constexpr double kHighest = 60;
  const double rate = private_nh.param("redraw_rate", kDefault);
  if (rate > 0 && rate <= kHighest) return rate;
  ROS_WARN("redraw_rate is %g; it must lie in (0, %g] per second. Using %g.", rate, kHighest,
           kDefault);
  return kDefault;
}

}  // namespace

TrajectoryView::TrajectoryView(ros::NodeHandle nh, ros::NodeHandle private_nh,
                               const pmeta::Experiment& experiment) {
  const pmeta::ExperimentSettings& settings = experiment.settings();
  const auto* family = dynamic_cast<const pmeta::GridworldFamily*>(&experiment.family());
  if (family == nullptr) {
    ROS_WARN("The viewer has no scene for environment '%s', only for gridworld: rviz stays empty.",
             settings.environment.c_str());
    return;
  }

  const int num_tasks = family->numTasks();
  for (int task = 0; task < num_tasks; ++task) {
    grids_.push_back({family->task(task), family->stride(), family->taskName(task)});
  }
  content_.experiment = settings.experiment;
  content_.rounds = settings.rounds;
  content_.has_trajectories = settings.publish_trajectories;
  content_.has_meta = experiment.evaluatesMeta();
  content_.tasks.resize(num_tasks);

  frames_.sendTransform(gridFrames(num_tasks));
  markers_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 1, true);
  // queues hold one round's messages of both policies; older ones may be dropped
  for (int task = 0; task < num_tasks && settings.publish_trajectories; ++task) {
    subscribers_.push_back(nh.subscribe("task_" + std::to_string(task) + "/trajectory",
                                        2 * kPolicies, &TrajectoryView::onTrajectory, this));
  }
  subscribers_.push_back(
      nh.subscribe("returns", 2 * kPolicies * num_tasks, &TrajectoryView::onReturn, this));
  subscribers_.push_back(nh.subscribe("round", 1, &TrajectoryView::onRound, this));
  timer_ = nh.createWallTimer(ros::WallDuration(1 / redrawRate(private_nh)),
                              &TrajectoryView::redraw, this);
}

void TrajectoryView::onTrajectory(const Trajectory::ConstPtr& trajectory) {
  if (trajectory->task >= grids_.size()) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a trajectory of task %u: there are tasks 0 to %zu.",
                      trajectory->task, grids_.size() - 1);
    return;
  }
  const std::string problem = trajectoryProblem(*trajectory, grids_[trajectory->task]);
  if (!problem.empty()) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a trajectory of task %u: %s", trajectory->task,
                      problem.c_str());
    return;
  }
  view(trajectory->task, trajectory->policy == Trajectory::META).episode = trajectory;
  changed_ = true;
}

void TrajectoryView::onReturn(const TaskReturn::ConstPtr& result) {
  const bool is_meta = result->policy == TaskReturn::META;
  if (result->task >= grids_.size() || (!is_meta && result->policy != TaskReturn::PERSONAL)) {
    ROS_WARN_THROTTLE(kWarnPeriod, "Ignored a return of task %u, policy %u.", result->task,
                      result->policy);
    return;
  }
  if (result->split == TaskReturn::TEST) return;
  view(result->task, is_meta).result = result;
  changed_ = true;
}

void TrajectoryView::onRound(const RoundSummary::ConstPtr& summary) {
  if (!content_.summary || content_.summary->run_id != summary->run_id) {
    forgetOtherRuns(summary->run_id);
  }
  content_.summary = summary;
  changed_ = true;
}

void TrajectoryView::redraw(const ros::WallTimerEvent&) {
  if (!changed_) return;
  changed_ = false;
  markers_.publish(gridworldScene(grids_, content_));
}

PolicyView& TrajectoryView::view(int task, bool is_meta) {
  return is_meta ? content_.tasks[task].meta : content_.tasks[task].personal;
}

void TrajectoryView::forgetOtherRuns(const std::string& run_id) {
  for (TaskView& task : content_.tasks) {
    for (PolicyView* view : {&task.personal, &task.meta}) {
      if (view->episode && view->episode->run_id != run_id) view->episode.reset();
      if (view->result && view->result->run_id != run_id) view->result.reset();
    }
  }
}

}  // namespace pmeta_nodes
