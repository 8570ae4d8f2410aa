#include <algorithm>
#include <map>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;

constexpr double kRoundTimeout = 3;  // as in silent_agent.test
constexpr double kSlack = 1;         // for a busy machine
constexpr std::uint32_t kSilent = 2;

bool names(const RoundSummary& summary, std::uint32_t task) {
  return std::count(summary.missing.begin(), summary.missing.end(), task) > 0;
}

// a stopped process keeps its connections: only its silence tells
TEST_F(RunOverRos, ASilentAgentIsNamedAtOnceAndNoRoundWaitsLongerThanItsDeadline) {
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 2; }));
  const int pid = pidOf("/pmeta/task_agent_2");
  ASSERT_GT(pid, 1);
  ASSERT_EQ(kill(pid, SIGSTOP), 0);
  const ros::WallTime stopped = ros::WallTime::now();
  ASSERT_TRUE(waitFor(
      [&] { return summary_->state == RoundSummary::LATE && names(*summary_, kSilent); }, 10));
  EXPECT_LE((ros::WallTime::now() - stopped).toSec(), 2.0);
  EXPECT_NE(summary_->message.find("task 2 (grid_6x6) is silent since "), std::string::npos)
      << summary_->message;
  EXPECT_NE(summary_->message.find(" goes on without them in "), std::string::npos)
      << summary_->message;

  std::uint32_t round = meta_->round;
  for (int i = 0; i < 2; ++i, ++round) {
    EXPECT_TRUE(waitFor([&] { return meta_->round > round; }, kRoundTimeout + kSlack));
    EXPECT_EQ(meta_->round, round + 1);
    EXPECT_EQ(meta_->participants, (std::vector<std::uint32_t>{0, 1, 3, 4}));
  }

  ASSERT_EQ(kill(pid, SIGCONT), 0);
  ASSERT_TRUE(waitFor([&] { return meta_->participants.size() == 5; }, 20)) << "it is not back";
  ASSERT_TRUE(waitFor([&] { return finished(); }));

  // every round is on record, those without the agent too
  std::map<std::uint32_t, bool> recorded;
  for (const RoundSummary& summary : history_) recorded[summary.round] = true;
  for (std::uint32_t r = 1; r <= summary_->rounds; ++r) EXPECT_TRUE(recorded[r]) << r;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("silent_agent_test")
