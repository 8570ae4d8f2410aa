#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <map>
#include <set>
#include <tuple>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;
using pmeta_msgs::Trajectory;

std_srvs::Trigger::Response evaluate() {
  std_srvs::Trigger service;
  EXPECT_TRUE(ros::service::waitForService("/pmeta/evaluate", 20000));
  EXPECT_TRUE(ros::service::call("/pmeta/evaluate", service));
  return service.response;
}

bool pause(bool on) {
  std_srvs::SetBool service;
  service.request.data = static_cast<std::uint8_t>(on);
  return ros::service::waitForService("/pmeta/pause", 20000) &&
         ros::service::call("/pmeta/pause", service) && service.response.success != 0;
}

class EvaluateOverRos : public RunOverRos {
 protected:
  // policy, task, round, exploration episodes
  using Key = std::tuple<int, int, int, int>;

  EvaluateOverRos() {
    returns_sub_ = nh_.subscribe("returns", 64, &EvaluateOverRos::onReturn, this);
    for (int task = 0; task < experiment_.totalTasks(); ++task) {
      episode_subs_.push_back(nh_.subscribe("task_" + std::to_string(task) + "/trajectory", 8,
                                            &EvaluateOverRos::onEpisode, this));
    }
  }

  std::set<Key> unscheduled_;
  std::map<std::pair<int, int>, Trajectory> episodes_;  // the newest, by task and policy

 private:
  void onReturn(const TaskReturn::ConstPtr& msg) {
    if (msg->scheduled) return;
    unscheduled_.insert({static_cast<int>(msg->policy), static_cast<int>(msg->task),
                         static_cast<int>(msg->round), static_cast<int>(msg->context_episodes)});
  }
  void onEpisode(const Trajectory::ConstPtr& msg) {
    episodes_[{static_cast<int>(msg->task), static_cast<int>(msg->policy)}] = *msg;
  }

  ros::Subscriber returns_sub_;
  std::vector<ros::Subscriber> episode_subs_;
};

TEST_F(EvaluateOverRos, EvaluatesOnceOutsideTheScheduleAndLeavesTheResultAsItIs) {
  // so that the next round is known
  ASSERT_TRUE(pause(true));
  ASSERT_TRUE(
      waitFor([&] { return meta_ && summary_ && summary_->state == RoundSummary::PAUSED; }, 20));
  const int next = static_cast<int>(meta_->round) + 1;
  ASSERT_LT(next + 1, static_cast<int>(meta_->rounds));
  EXPECT_TRUE(unscheduled_.empty());
  EXPECT_TRUE(evaluate().success);
  ASSERT_TRUE(pause(false));

  std::set<Key> expected;
  for (int task = 0; task < 3; ++task) {
    for (const int episodes : {0, 5, 15}) expected.insert({TaskReturn::META, task, next, episodes});
    if (task < 2) expected.insert({TaskReturn::PERSONAL, task, next + 1, 0});
  }
  EXPECT_TRUE(waitFor([&] { return unscheduled_ == expected && episodes_.size() == 5; }, 20));
  for (const auto& [key, episode] : episodes_) {
    EXPECT_EQ(episode.action_grid, 21u);
    EXPECT_EQ(episode.action_values.size(), 441u);
    EXPECT_LT(ros::serialization::serializationLength(episode), 6000u);
  }

  ASSERT_TRUE(waitFor([&] { return finished(); }));
  EXPECT_EQ(unscheduled_, expected) << "one meta-policy alone";
  expectEqualsLocal();

  const std_srvs::Trigger::Response late = evaluate();
  EXPECT_FALSE(late.success);
  EXPECT_NE(late.message.find("the last meta-policy is out"), std::string::npos) << late.message;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("evaluate_test")
