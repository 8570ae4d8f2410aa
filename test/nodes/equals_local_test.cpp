#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

TEST_F(RunOverRos, EqualsTheLocalRunnerBitForBit) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();
}

TEST_F(RunOverRos, TopicsReadWellInPlainRosTools) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  const std::string returns = output("timeout 20 rostopic echo -n 1 /pmeta/returns");
  EXPECT_NE(returns.find("task_name: \"" + taskPrefix()), std::string::npos) << returns;
  EXPECT_NE(returns.find("policy_name: "), std::string::npos) << returns;
  EXPECT_NE(returns.find("return_mean: "), std::string::npos) << returns;

  const std::string topics = output("timeout 20 rostopic list");
  const std::string last = "/pmeta/task_" + std::to_string(experiment_.totalTasks() - 1);
  for (const std::string& topic :
       {std::string("/pmeta/agent_status"), std::string("/pmeta/auxiliary"),
        std::string("/pmeta/meta_policy"), std::string("/pmeta/returns"),
        std::string("/pmeta/round"), std::string("/pmeta/task_0/trajectory"), last + "/trajectory",
        std::string("/diagnostics")}) {
    EXPECT_NE(topics.find(topic), std::string::npos) << topic << " is not in\n" << topics;
  }
  const std::string round = output("timeout 20 rostopic echo -n 1 /pmeta/round/message");
  EXPECT_NE(round.find("all rounds are done"), std::string::npos) << round;
  const std::string description = output("timeout 20 rosmsg show pmeta_msgs/MetaPolicy");
  EXPECT_NE(description.find("pmeta_msgs/ModelBlob model"), std::string::npos) << description;
}

TEST_F(RunOverRos, EveryAgentEndsInStateDone) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  const int agents = experiment_.totalTasks();
  const std::string echo = output("timeout 20 rostopic echo -n " + std::to_string(agents) +
                                  " /pmeta/agent_status/state");
  int done = 0;
  for (std::size_t at = echo.find("4\n"); at != std::string::npos; at = echo.find("4\n", at + 1)) {
    ++done;
  }
  EXPECT_EQ(done, agents) << echo;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("equals_local_test")
