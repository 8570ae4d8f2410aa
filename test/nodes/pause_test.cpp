#include <std_srvs/SetBool.h>

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

// a round takes 0.3 s here
TEST_F(RunOverRos, APausedRunMakesNoNewRoundAndAResumedOneEndsWithTheSameResult) {
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
