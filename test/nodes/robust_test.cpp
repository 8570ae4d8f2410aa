#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

TEST_F(RunOverRos, WhoIsLeftOutIsNamedAndTheSameAsInOneProcess) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();

  const pmeta::LocalResult local = pmeta::runLocally(experiment_);
  int seen = 0, excluding = 0;
  for (const pmeta_msgs::RoundSummary& msg : history_) {
    if (msg.message.find("is complete") == std::string::npos) continue;
    const pmeta::RoundSummary& expected = local.rounds.at(msg.round - 1).summary;
    const pmeta::RoundSummary got = fromMsg(msg);
    EXPECT_EQ(got.excluded, expected.excluded) << "round " << msg.round;
    EXPECT_EQ(got.participants, expected.participants) << "round " << msg.round;
    EXPECT_TRUE(got.missing.empty());
    const bool names =
        msg.message.find("; the updates left out are those of task ") != std::string::npos;
    EXPECT_EQ(names, !got.excluded.empty()) << msg.message;
    ++seen;
    excluding += names ? 1 : 0;
  }
  EXPECT_GT(seen, 1);
  EXPECT_GT(excluding, 0);
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("robust_test")
