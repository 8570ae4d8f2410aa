#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

TEST_F(RunOverRos, AKilledAgentComesBackAndTheResultIsTheSame) {
  int kills = 0;
  for (const int round : {3, 8, 15}) {
    ASSERT_TRUE(waitFor([&] { return roundsDone() >= round; }));
    const std::string node = "/pmeta/task_agent_" + std::to_string(kills + 1);
    const int pid = pidOf(node);
    ASSERT_GT(pid, 1) << node;
    ASSERT_EQ(kill(pid, SIGKILL), 0);
    ++kills;
    ASSERT_TRUE(waitFor([&] { return pidOf(node) > 1 && pidOf(node) != pid; })) << node;
  }
  EXPECT_FALSE(finished()) << "the run was over before the last kill";
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("respawn_test")
