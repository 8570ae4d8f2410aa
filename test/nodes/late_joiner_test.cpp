#include <spawn.h>
#include <sys/wait.h>

#include "run_over_ros.h"

extern char** environ;

namespace pmeta_nodes {
namespace {

// the launch file starts agents 0 to 3; this one comes when the round is already late
TEST_F(RunOverRos, ALateJoinerIsNamedThenTakesPart) {
  const auto late = [&] { return summary_ && summary_->state == pmeta_msgs::RoundSummary::LATE; };
  ASSERT_TRUE(waitFor(late));
  EXPECT_EQ(summary_->missing, std::vector<std::uint32_t>{4});
  EXPECT_NE(summary_->message.find("task 4 (grid_8x8)"), std::string::npos) << summary_->message;
  EXPECT_NE(summary_->message.find("round 1 waits until all 5 tasks have reported"),
            std::string::npos);
  EXPECT_EQ(summary_->round, 0u);

  const char* arguments[] = {"rosrun",       "pmeta_nodes",          "task_agent", "_task:=4",
                             "__ns:=/pmeta", "__name:=task_agent_4", nullptr};
  pid_t pid = -1;
  ASSERT_EQ(posix_spawnp(&pid, "rosrun", nullptr, nullptr, const_cast<char**>(arguments), environ),
            0);
  EXPECT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();

  kill(pid, SIGINT);
  int status = -1;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0)
      << "no clean end on SIGINT: " << status;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("late_joiner_test")
