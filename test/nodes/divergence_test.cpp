#include <pmeta_msgs/AgentStatus.h>

#include <nlohmann/json.hpp>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;
using pmeta_msgs::RoundSummary;

// a run of five tasks of which one is there, and that one diverges
TEST_F(RunOverRos, AnAgentThatDivergesEndsTheRunWithASentence) {
  AgentStatus status;
  const auto keep = [&](const AgentStatus::ConstPtr& msg) { status = *msg; };
  const ros::Subscriber statuses = nh_.subscribe<AgentStatus>(
      "agent_status", 8, boost::function<void(const AgentStatus::ConstPtr&)>(keep));
  ASSERT_TRUE(waitFor([&] { return summary_ && summary_->state == RoundSummary::STOPPED; }, 40));
  const std::string name = experiment_.family().taskName(0);
  EXPECT_EQ(summary_->message.rfind("task 0 (" + name + ") failed in round 1: ", 0), 0u)
      << summary_->message;
  EXPECT_NE(summary_->message.find("lower personal.learning_rate (1e+30)"), std::string::npos)
      << summary_->message;

  const std::string path = experiment_.runDir() + "/manifest.json";
  const auto manifest = nlohmann::json::parse(std::ifstream(path));
  EXPECT_EQ(manifest["status"], "failed");
  EXPECT_EQ(manifest["reason"], summary_->message);

  // it would only do the same again: it says so until the run is gone
  ASSERT_TRUE(waitFor([&] { return status.state == AgentStatus::FAILED; }, 10));
  EXPECT_EQ(status.message, summary_->message);
  const int pid = pidOf("/pmeta/task_agent_0");
  const std::size_t heard = history_.size();
  ASSERT_TRUE(waitFor([&] { return history_.size() > heard; }, 10)) << "the last words come again";
  EXPECT_EQ(pidOf("/pmeta/task_agent_0"), pid) << "it was started again";
  EXPECT_EQ(status.state, AgentStatus::FAILED);
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("divergence_test")
