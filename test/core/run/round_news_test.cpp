#include <gtest/gtest.h>

#include "grid_rounds.h"

namespace pmeta {
namespace {

using test::GridRun;
using Asked = std::vector<std::string>;
using State = RunStanding::State;
using Tasks = std::vector<int>;

TEST(RoundNews, WithoutAQuorumALateRoundWaitsAndSaysForWhom) {
  GridRun run({"round_timeout:=30"});
  run.begin(0);
  run.report(0, 1);
  run.outlet.asked();
  run.step(29);
  EXPECT_TRUE(run.outlet.told.empty());
  run.step(31);
  ASSERT_EQ(run.outlet.told.size(), 1u);
  EXPECT_EQ(run.outlet.told[0].state, State::kLate);
  EXPECT_EQ(run.outlet.told[0].message,
            "round 1 has waited 31 s for task 1 (grid_3x3), task 2 (grid_4x4); round 1 waits until "
            "all 3 tasks have reported");
  EXPECT_EQ(run.outlet.told[0].missing, (Tasks{1, 2}));
  EXPECT_EQ(run.outlet.logged.back(), "warning: " + run.outlet.told[0].message);
  EXPECT_EQ(run.outlet.asked(), Asked{"repeat"}) << "they may have missed the meta-policy";
  run.step(35);
  EXPECT_EQ(run.outlet.told.size(), 1u) << "every five seconds";
  run.report(2, 1);
  run.step(36);
  ASSERT_EQ(run.outlet.told.size(), 2u);
  EXPECT_EQ(run.outlet.told[1].missing, Tasks{1});

  // the updates are in, and only a return is waited for
  run.update(1, 1);
  run.step(41);
  EXPECT_EQ(run.outlet.told.back().missing, (Tasks{0, 1, 2})) << "meta returns come later anyway";
  EXPECT_EQ(run.driver.round(), 0);
  run.result(1, 1, PolicyKind::kPersonal);
  run.step(1000);
  EXPECT_EQ(run.driver.round(), 1);
}

TEST(RoundNews, SaysWhenARoundGoesOnWithoutTheMissing) {
  GridRun run({"round_timeout:=30", "quorum:=2"}, {0, 0, 1.5, 15});
  run.begin(0);
  run.step(16);
  EXPECT_EQ(run.outlet.told.back().state, State::kLate);
  const std::string message = run.outlet.told.back().message;
  EXPECT_EQ(message.rfind("task 0 (grid_2x2) has not shown up since ", 0), 0u) << message;
  const std::string what = "; round 1 goes on without them in 14 s if 2 of 3 tasks have reported";
  EXPECT_EQ(message.substr(message.size() - what.size()), what);
  run.step(32);
  EXPECT_NE(run.outlet.told.back().message.find("without them once 2 of 3 tasks have reported"),
            std::string::npos)
      << run.outlet.told.back().message;
}

TEST(RoundNews, NamesTheMachineOfWhoIsMissing) {
  GridRun run({"round_timeout:=30", "machines.robot.host:=10.0.0.2", "machines.robot.tasks:=[1]",
               "machines.robot.env_loader:=/env.sh"});
  run.begin(0);
  run.report(0, 1);
  run.step(31);
  EXPECT_EQ(run.outlet.told[0].message,
            "round 1 has waited 31 s for task 1 (grid_3x3) on robot, task 2 (grid_4x4); round 1 "
            "waits until all 3 tasks have reported");
}

TEST(RoundNews, NamesWhoFallsSilentAndWhoIsBack) {
  GridRun run({}, {0, 0, 1.5, 15});
  run.begin(0);
  for (const int task : {0, 1, 2}) run.driver.heard(task, GridRun::at(1));
  run.step(2);
  EXPECT_TRUE(run.outlet.told.empty());
  run.driver.heard(0, GridRun::at(2.4));
  run.driver.heard(2, GridRun::at(2.4));
  run.step(2.6);
  ASSERT_EQ(run.outlet.told.size(), 1u);
  EXPECT_EQ(run.outlet.told[0].state, State::kLate);
  EXPECT_EQ(run.outlet.told[0].missing, Tasks{1});
  EXPECT_EQ(run.outlet.told[0].message.rfind("task 1 (grid_3x3) is silent since ", 0), 0u);

  // whatever is said while it is missing says so too
  run.driver.say("refused: a stranger", GridRun::at(2.7));
  EXPECT_EQ(run.outlet.told[1].state, State::kLate);
  EXPECT_NE(run.outlet.told[1].message.find("; refused: a stranger"), std::string::npos);
  run.step(2.8);
  EXPECT_EQ(run.outlet.told.size(), 2u) << "once";
  run.driver.heard(1, GridRun::at(3));
  run.step(3);
  EXPECT_EQ(run.outlet.told.back().state, State::kRunning);
  EXPECT_EQ(run.outlet.told.back().message, "running");
  EXPECT_EQ(run.outlet.logged.back(), "info: task 1 (grid_3x3): heard of again.");
}

TEST(RoundNews, SaysWhoseUpdatesAreLeftOut) {
  GridRun run({"max_update_norm:=100"});
  run.begin(0);
  run.report(0, 1);
  run.report(2, 1);
  run.update(1, 1, 1000);
  run.result(1, 1, PolicyKind::kPersonal);
  run.step(1);
  EXPECT_EQ(run.driver.round(), 1) << "nothing waits for it";
  const std::string line = run.outlet.logged.back();
  EXPECT_EQ(line.rfind("warning: round 1 leaves out the update of task 1 (grid_3x3): its distance "
                       "to the meta-policy, ",
                       0),
            0u)
      << line;
  run.metaReturns(1);
  run.step(2);
  EXPECT_EQ(run.outlet.told.back().message,
            "round 1 is complete; the updates left out are those of task 1 (grid_3x3)");
  EXPECT_EQ(run.outlet.rounds.at(0).summary.excluded, Tasks{1});
}

}  // namespace
}  // namespace pmeta
