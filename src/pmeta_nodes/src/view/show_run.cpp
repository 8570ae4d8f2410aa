#include "view/show_run.h"

#include <cstdint>
#include <limits>
#include <numeric>

#include "common/conversions.h"

namespace pmeta_nodes {
namespace {

double meanOf(const std::vector<pmeta_msgs::TaskReturn>& returns, int policy, int split) {
  double sum = 0;
  int count = 0;
  for (const pmeta_msgs::TaskReturn& result : returns) {
    if (result.policy != policy || result.split != split) continue;
    sum += result.return_mean;
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / count;
}

}  // namespace

ShowRun::ShowRun(ros::NodeHandle nh, const pmeta::FinishedRun& run) : run_(run) {
  const std::string& other_package = run.experiment().otherPackage();
  if (!other_package.empty()) ROS_WARN("%s", other_package.c_str());
  advertise(nh);
  summarise();
}

void ShowRun::advertise(ros::NodeHandle& nh) {
  const int tasks = run_.experiment().totalTasks();
  for (int task = 0; task < tasks; ++task) {
    const auto send_all = [this, task](const ros::SingleSubscriberPublisher& late) {
      for (const pmeta_msgs::Trajectory& trajectory : trajectories_) {
        if (trajectory.task == static_cast<std::uint32_t>(task)) late.publish(trajectory);
      }
    };
    trajectory_pubs_.push_back(nh.advertise<pmeta_msgs::Trajectory>(
        "task_" + std::to_string(task) + "/trajectory", 2, send_all));
  }
  return_pub_ =
      nh.advertise<pmeta_msgs::TaskReturn>("returns", static_cast<std::uint32_t>(2 * tasks),
                                           [this](const ros::SingleSubscriberPublisher& late) {
                                             for (const pmeta_msgs::TaskReturn& result : returns_)
                                               late.publish(result);
                                           });
  round_pub_ = nh.advertise<pmeta_msgs::RoundSummary>("round", 1, true);
}

void ShowRun::evaluate(const std::function<bool()>& pause) {
  for (int task = 0; task < run_.experiment().numTasks(); ++task) {
    if (const auto personal = run_.personal(task)) show(*personal);
    if (!pause()) return;
  }
  for (const pmeta::ShownPolicy& meta : run_.meta()) show(meta);
  summarise();
}

void ShowRun::show(const pmeta::ShownPolicy& shown) {
  const pmeta::Experiment& experiment = run_.experiment();
  const pmeta::TaskReturn& result = shown.result;
  returns_.push_back(toMsg(result, experiment.family().taskName(result.task)));
  returns_.back().header.stamp = ros::Time::now();
  return_pub_.publish(returns_.back());
  trajectories_.push_back(
      toMsg(shown.episode, experiment, result.task, result.round, result.policy));
  trajectories_.back().header.stamp = ros::Time::now();
  trajectory_pubs_.at(static_cast<std::size_t>(result.task)).publish(trajectories_.back());
}

void ShowRun::summarise() {
  using pmeta_msgs::TaskReturn;
  pmeta::RoundSummary summary;
  summary.run_id = run_.experiment().settings().run_id;
  summary.round = run_.round();
  summary.rounds = run_.experiment().settings().rounds;
  summary.participants.resize(static_cast<std::size_t>(run_.experiment().numTasks()));
  std::iota(summary.participants.begin(), summary.participants.end(), 0);
  summary.personal_return = meanOf(returns_, TaskReturn::PERSONAL, TaskReturn::TRAIN);
  summary.meta_return = meanOf(returns_, TaskReturn::META, TaskReturn::TRAIN);
  summary.test_return = meanOf(returns_, TaskReturn::META, TaskReturn::TEST);
  pmeta_msgs::RoundSummary msg = toMsg(summary, run_.experiment());
  msg.header.stamp = ros::Time::now();
  msg.state = pmeta_msgs::RoundSummary::FINISHED;
  msg.state_name = stateName(msg);
  msg.message = "showing the policies of run " + summary.run_id + "; nothing is trained";
  round_pub_.publish(msg);
}

}  // namespace pmeta_nodes
