#include <map>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

constexpr char kAggregator[] = "/pmeta/meta_aggregator";

class Restart : public RunOverRos {
 protected:
  void killAndAwait(const std::vector<std::string>& nodes) {
    std::map<std::string, int> pids;
    for (const std::string& node : nodes) {
      pids[node] = pidOf(node);
      ASSERT_GT(pids[node], 1) << node;
    }
    for (const auto& [node, pid] : pids) ASSERT_EQ(kill(pid, SIGKILL), 0);
    for (const auto& [node, pid] : pids) {
      ASSERT_TRUE(waitFor([&, node = node, pid = pid] {
        return pidOf(node) > 1 && pidOf(node) != pid;
      })) << node;
    }
  }
};

TEST_F(Restart, AKilledAggregatorGoesOnFromItsCheckpointAndTheResultIsTheSame) {
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 3; }));
  killAndAwait({kAggregator});
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 8; }));
  killAndAwait({kAggregator, "/pmeta/task_agent_2"});
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 14; }));
  killAndAwait({kAggregator, "/pmeta/task_agent_0", "/pmeta/task_agent_1", "/pmeta/task_agent_2",
                "/pmeta/task_agent_3", "/pmeta/task_agent_4"});
  EXPECT_FALSE(finished()) << "the run was over before the last kill";
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();

  // one that is killed after the end says so again
  summary_.reset();
  killAndAwait({kAggregator});
  EXPECT_TRUE(waitFor([&] { return finished(); }));
  EXPECT_EQ(pmeta::runStatus(experiment_.runDir()), "finished");
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("restart_test")
