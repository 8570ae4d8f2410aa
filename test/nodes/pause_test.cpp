#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/Scores.h>
#include <pmeta_msgs/TaskReturn.h>
#include <std_srvs/SetBool.h>

#include <set>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;

std_srvs::SetBool::Response pause(bool on) {
  std_srvs::SetBool service;
  service.request.data = static_cast<std::uint8_t>(on);
  EXPECT_TRUE(ros::service::waitForService("/pmeta/pause", 20000));
  EXPECT_TRUE(ros::service::call("/pmeta/pause", service));
  return service.response;
}

/// Whoever comes while a run is paused.
class PausedRun : public RunOverRos {
 protected:
  // agents are a round ahead: the returns of the last complete round are there too
  void lookOnLate() {
    using pmeta_msgs::TaskReturn;
    const std::uint32_t round = summary_->round;
    EXPECT_EQ(summary_->state_name, "paused");
    std::set<std::uint32_t> personal;
    std::set<std::uint32_t> meta;
    const ros::Subscriber returns = nh_.subscribe<TaskReturn>(
        "returns", 64,
        boost::function<void(const TaskReturn::ConstPtr&)>([&](const TaskReturn::ConstPtr& msg) {
          if (msg->round == round)
            (msg->policy == TaskReturn::META ? meta : personal).insert(msg->task);
        }));
    pmeta_msgs::Scores::ConstPtr scores;
    const ros::Subscriber scores_sub = nh_.subscribe<pmeta_msgs::Scores>(
        "scores", 1,
        boost::function<void(const pmeta_msgs::Scores::ConstPtr&)>(
            [&](const pmeta_msgs::Scores::ConstPtr& msg) { scores = msg; }));
    std::set<std::string> states;
    const ros::Subscriber status = nh_.subscribe<pmeta_msgs::AgentStatus>(
        "agent_status", 64,
        boost::function<void(const pmeta_msgs::AgentStatus::ConstPtr&)>(
            [&](const pmeta_msgs::AgentStatus::ConstPtr& msg) { states.insert(msg->state_name); }));
    EXPECT_TRUE(waitFor(
        [&] {
          return personal.size() == 5 && meta.size() == 5 && scores && states.count("waiting") == 1;
        },
        20))
        << personal.size() << " personal and " << meta.size() << " meta returns";
    ASSERT_TRUE(scores);
    EXPECT_EQ(scores->round, round);
    EXPECT_EQ(scores->tasks.size(), 5u);
    EXPECT_EQ(scores->tasks.at(4), "grid_8x8");
    EXPECT_EQ(scores->personal_mean, summary_->personal_return);
    EXPECT_EQ(scores->meta_mean, summary_->meta_return);
    EXPECT_EQ(output("rosparam get /pmeta/settings/personal/lambda"), "10\n");
  }
};

// a round takes 0.3 s here
TEST_F(PausedRun, APausedRunMakesNoNewRoundAndAResumedOneEndsWithTheSameResult) {
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 2; }));
  EXPECT_TRUE(pause(true).success);
  ASSERT_TRUE(waitFor([&] { return summary_->state == RoundSummary::PAUSED; }, 10));
  EXPECT_EQ(summary_->message.rfind("paused: ", 0), 0u) << summary_->message;
  ASSERT_TRUE(meta_);
  const std::uint32_t held = meta_->round;
  ASSERT_LT(held, meta_->rounds);

  // in as much time as five rounds take
  EXPECT_FALSE(waitFor([&] { return meta_->round != held; }, 1.5));
  EXPECT_EQ(summary_->state, RoundSummary::PAUSED) << summary_->message;
  EXPECT_EQ(summary_->round, held) << "the returns of the last meta-policy are still taken";
  EXPECT_TRUE(pause(true).success) << "twice is once";
  lookOnLate();

  EXPECT_TRUE(pause(false).success);
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();
  for (const RoundSummary& round : history_) {
    EXPECT_LT(round.round_s, 1.4) << "the pause counts in round " << round.round;
  }

  const std_srvs::SetBool::Response late = pause(true);
  EXPECT_FALSE(late.success);
  EXPECT_NE(late.message.find("the rounds are over"), std::string::npos) << late.message;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("pause_test")
