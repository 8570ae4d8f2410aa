#include <pmeta_msgs/TaskReturn.h>

#include <map>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

TEST_F(RunOverRos, AServerThatIsKilledTenTimesCostsTheEpisodesThatItWasIn) {
  std::map<std::uint32_t, pmeta_msgs::TaskReturn> last;  // of the personal policies, by task
  const ros::Subscriber returns = nh_.subscribe<pmeta_msgs::TaskReturn>(
      "returns", 100, [&](const pmeta_msgs::TaskReturn::ConstPtr& msg) {
        if (msg->policy == pmeta_msgs::TaskReturn::PERSONAL) last[msg->task] = *msg;
      });
  constexpr int kKills = 10;
  const std::string server = "/cart_pole_0/cart_pole_server";
  int pid = -1;
  for (int kills = 0; kills < kKills; ++kills) {
    ASSERT_TRUE(waitFor([&] { return roundsDone() > kills; })) << kills;
    const int before = pid;
    ASSERT_TRUE(waitFor([&] { return (pid = pidOf(server)) > 1 && pid != before; })) << kills;
    ASSERT_EQ(kill(pid, SIGKILL), 0);
  }
  // the agent itself: it goes on from its checkpoint, but not with the episode that it was in
  ASSERT_TRUE(waitFor([&] { return roundsDone() > kKills; }));
  ASSERT_EQ(kill(pidOf("/pmeta/task_agent_0"), SIGKILL), 0);
  EXPECT_FALSE(finished()) << "the run was over before the last kill";
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  EXPECT_EQ(roundsDone(), experiment_.settings().rounds);
  EXPECT_EQ(pmeta::runStatus(experiment_.runDir()), "finished");

  // every step that was asked for has been learnt from, but for those that broke an episode
  ASSERT_TRUE(waitFor([&] { return last.size() == 2; }, 10));
  const pmeta_msgs::TaskReturn& killed = last[0];
  const pmeta_msgs::TaskReturn& undisturbed = last[1];
  EXPECT_EQ(undisturbed.broken_episodes, 0u);
  // between two episodes there is none to lose
  EXPECT_GT(killed.broken_episodes, kKills / 2u);
  EXPECT_LE(killed.broken_episodes, static_cast<unsigned>(kKills));
  EXPECT_EQ(killed.env_steps + killed.broken_episodes, undisturbed.env_steps);
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("remote_restart_test")
