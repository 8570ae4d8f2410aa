#include "pmeta_core/run/round_driver.h"

#include <gtest/gtest.h>

#include "../memory_state.h"
#include "grid_rounds.h"

namespace pmeta {
namespace {

using test::GridRun;
using Asked = std::vector<std::string>;
using State = RunStanding::State;
using Tasks = std::vector<int>;

TEST(RoundDriver, ARoundIsClosedOnceAllUpdatesAndReturnsAreIn) {
  GridRun run;
  run.begin(0);
  EXPECT_EQ(run.outlet.asked(), Asked{"publish 0"});
  run.report(0, 1);
  run.report(1, 1);
  run.update(2, 1);
  run.step(2);
  EXPECT_EQ(run.outlet.asked(), Asked{}) << "a personal return is missing, and may still come";
  EXPECT_EQ(run.driver.round(), 0);
  run.result(2, 1, PolicyKind::kPersonal);
  run.step(3);
  EXPECT_EQ(run.outlet.asked(), Asked{"publish 1"});

  // the next updates are in, the returns of this meta-policy not yet
  run.reportAll(2);
  run.step(4);
  EXPECT_EQ(run.outlet.asked(), Asked{});
  run.metaReturns(1);
  run.step(5);
  EXPECT_EQ(run.outlet.asked(), (Asked{"show 1", "write 1", "publish 2"}));
  EXPECT_EQ(run.outlet.told.back().state, State::kRunning);
  EXPECT_EQ(run.outlet.told.back().message, "round 1 is complete");

  ASSERT_EQ(run.outlet.rounds.size(), 1u);
  const RoundBook::Round& round = run.outlet.rounds[0];
  EXPECT_EQ(round.summary.seconds, 3) << "from the meta-policy to the aggregation";
  EXPECT_EQ(round.summary.participants, (Tasks{0, 1, 2}));
  EXPECT_EQ(round.rows.size(), 6u);
}

TEST(RoundDriver, EndsWithTheReturnsOfTheLastMetaPolicy) {
  GridRun run({"rounds:=2"});
  run.begin(0);
  run.wholeRound(1, 1);
  run.reportAll(2);
  run.step(2);
  EXPECT_EQ(run.driver.round(), 2);
  EXPECT_FALSE(run.driver.done());
  run.metaReturns(2);
  run.outlet.disk_error = "the disk is full.";
  run.step(3);
  EXPECT_FALSE(run.driver.done()) << "it is not written";
  run.outlet.disk_error = "";
  run.step(5);
  EXPECT_TRUE(run.driver.done());
  run.step(6);
  EXPECT_TRUE(run.driver.end(GridRun::at(7)));
  EXPECT_EQ(run.outlet.rounds.size(), 2u);
}

TEST(RoundDriver, RoundsThatAreNotEvaluatedWaitForNoReturns) {
  GridRun run({"evaluation_interval:=2"});
  run.begin(0);
  for (const int task : {0, 1, 2}) run.update(task, 1);
  run.step(1);
  EXPECT_EQ(run.outlet.asked(), (Asked{"publish 0", "publish 1"}));
  run.reportAll(2);
  run.step(2);
  EXPECT_EQ(run.outlet.asked(), (Asked{"show 1", "write 1", "publish 2"}));
  EXPECT_TRUE(run.outlet.rounds[0].rows.empty());
}

TEST(RoundDriver, KeepsThePace) {
  GridRun run({"pace:=0.5"});
  run.begin(10);
  run.reportAll(1);
  run.step(10.4);
  EXPECT_EQ(run.driver.round(), 0);
  run.step(10.5);
  EXPECT_EQ(run.driver.round(), 1);
  run.metaReturns(1);
  run.reportAll(2);
  run.step(10.9);
  EXPECT_EQ(run.driver.round(), 1);
  run.step(11);
  EXPECT_EQ(run.driver.round(), 2);
}

TEST(RoundDriver, ALateRoundIsClosedByAQuorumOfFewerThanAll) {
  GridRun run({"quorum:=2", "round_timeout:=30"});
  run.begin(0);
  run.report(2, 1);
  run.step(31);
  EXPECT_EQ(run.driver.round(), 0) << "one is no quorum";
  run.report(0, 1);
  run.step(40);
  EXPECT_EQ(run.driver.round(), 1) << "as soon as there is one";
  EXPECT_EQ(run.outlet.logged.back(),
            "warning: round 1 was closed by quorum without task 1 (grid_3x3).");

  // in time, and its record is closed as it is
  run.report(0, 2);
  run.report(1, 2);
  run.step(70);
  EXPECT_EQ(run.driver.round(), 1) << "not before its deadline";
  run.step(70.1);
  EXPECT_EQ(run.driver.round(), 2);
  ASSERT_EQ(run.outlet.rounds.size(), 1u);
  EXPECT_EQ(run.outlet.rounds[0].summary.missing, Tasks{1});
  EXPECT_EQ(run.outlet.rounds[0].summary.participants, (Tasks{0, 2}));
  EXPECT_EQ(run.outlet.rounds[0].summary.seconds, 40);
  EXPECT_EQ(run.outlet.rounds[0].rows.size(), 2u) << "nobody evaluated the meta-policy";
}

TEST(RoundDriver, WithAQuorumTheLastReturnsAreNotWaitedForForEver) {
  GridRun run({"quorum:=2", "round_timeout:=30", "rounds:=1"});
  run.begin(0);
  run.reportAll(1);
  run.step(1);
  run.result(0, 1, PolicyKind::kMeta);
  run.step(31);
  EXPECT_FALSE(run.driver.done());
  run.step(31.1);
  run.step(31.2);
  EXPECT_TRUE(run.driver.done());
  EXPECT_EQ(run.outlet.rounds.at(0).rows.size(), 4u);
}

TEST(RoundDriver, APauseHoldsTheNextMetaPolicyBackAndDoesNotCount) {
  GridRun run;
  run.begin(0);
  const RoundDriver::Answer answer = run.driver.pause(true);
  EXPECT_TRUE(answer.taken);
  run.step(1);
  EXPECT_EQ(run.outlet.told.back().state, State::kPaused);
  EXPECT_EQ(run.outlet.told.back().message, answer.message);
  run.reportAll(1);
  run.step(2);
  run.step(100);
  EXPECT_EQ(run.driver.round(), 0);
  EXPECT_EQ(run.outlet.told.size(), 1u) << "who is paused is late for nobody";
  EXPECT_TRUE(run.driver.pause(false).taken);
  run.step(200);
  EXPECT_EQ(run.driver.round(), 1);
  EXPECT_EQ(run.outlet.told.back().message, "running");
  run.metaReturns(1);
  run.step(201);
  EXPECT_EQ(run.outlet.rounds.at(0).summary.seconds, 2);
}

TEST(RoundDriver, APauseTakesTheReturnsOfTheRoundBefore) {
  GridRun run;
  run.begin(0);
  run.reportAll(1);
  run.step(1);
  run.driver.pause(true);
  run.metaReturns(1);
  run.step(2);
  EXPECT_EQ(run.outlet.rounds.size(), 1u);
  EXPECT_EQ(run.driver.round(), 1);
}

TEST(RoundDriver, NothingIsPausedPastTheLastAggregation) {
  GridRun run({"rounds:=1"});
  run.begin(0);
  run.driver.pause(true);
  run.step(0);
  run.driver.pause(false);
  run.reportAll(1);
  run.step(1);
  run.driver.pause(true);
  run.step(2);
  EXPECT_NE(run.outlet.told.back().state, State::kPaused);
  run.metaReturns(1);
  run.step(3);
  run.driver.end(GridRun::at(3));
  const RoundDriver::Answer late = run.driver.pause(true);
  EXPECT_FALSE(late.taken);
  EXPECT_EQ(late.message, "the rounds are over: there is nothing to pause");
}

TEST(RoundDriver, WhileTheDiskTakesNothingTheRoundIsHeld) {
  GridRun run;
  run.begin(0);
  run.reportAll(1);
  run.step(1);
  run.metaReturns(1);
  run.outlet.asked();
  run.outlet.disk_error = "the disk is full.";
  run.step(2);
  EXPECT_EQ(run.outlet.asked(), (Asked{"show 1", "failed write 1"}));
  EXPECT_EQ(run.outlet.told.back().state, State::kBlocked);
  EXPECT_EQ(run.outlet.told.back().message,
            "the disk is full. The run is held until that is mended.");
  EXPECT_EQ(run.outlet.logged.back(),
            "error: the disk is full. The run is held until that is mended; it is tried again "
            "every 2 s.");
  EXPECT_EQ(run.driver.diskTrouble(), "the disk is full.");

  // updates are taken, the round stays open, and nothing is told twice
  const std::size_t told = run.outlet.told.size();
  run.reportAll(2);
  run.step(3.9);
  EXPECT_EQ(run.outlet.asked(), Asked{});
  run.step(4);
  EXPECT_EQ(run.outlet.asked(), Asked{"failed write 1"});
  EXPECT_EQ(run.outlet.told.size(), told);
  EXPECT_EQ(run.driver.round(), 1);

  run.outlet.disk_error = "";
  run.step(5);
  EXPECT_EQ(run.driver.round(), 1);
  run.step(6);
  EXPECT_EQ(run.outlet.asked(), (Asked{"write 1", "publish 2"}));
  EXPECT_EQ(run.outlet.rounds.size(), 1u);
  EXPECT_EQ(run.outlet.told.back().state, State::kRunning);
  EXPECT_EQ(run.driver.diskTrouble(), "");
}

TEST(RoundDriver, AMetaPolicyWaitsForItsCheckpoint) {
  GridRun run({"checkpoint.interval:=1"});
  run.begin(0);
  run.outlet.disk_error = "no space.";
  run.reportAll(1);
  run.step(1);
  EXPECT_EQ(run.outlet.asked(), (Asked{"publish 0", "failed checkpoint 1"}));
  EXPECT_EQ(run.driver.round(), 1) << "it is mixed, but nobody has seen it";
  run.driver.pause(true);
  run.step(2);
  EXPECT_EQ(run.outlet.told.back().state, State::kBlocked) << "that comes first";
  run.outlet.disk_error = "another trouble.";
  run.step(3);
  EXPECT_EQ(run.outlet.told.back().message,
            "another trouble. The run is held until that is mended.");
  run.outlet.disk_error = "";
  run.step(5);
  EXPECT_EQ(run.outlet.asked(), (Asked{"failed checkpoint 1", "checkpoint 1", "publish 1"}));
}

TEST(RoundDriver, ACheckpointIsSavedAtItsIntervalBeforeTheMetaPolicyGoesOut) {
  GridRun run({"checkpoint.interval:=2"});
  run.begin(0);
  run.wholeRound(1, 1);
  run.outlet.asked();
  run.wholeRound(2, 2);
  EXPECT_EQ(run.outlet.asked(), (Asked{"checkpoint 2", "publish 2", "show 2", "write 2"}));
}

TEST(RoundDriver, ACheckpointThatIsAskedForIsOfTheNextRoundAlone) {
  GridRun run;
  run.begin(0);
  EXPECT_TRUE(run.driver.askForCheckpoint().taken);
  EXPECT_TRUE(run.driver.askForCheckpoint().taken) << "twice is once";
  run.wholeRound(1, 1);
  EXPECT_EQ(run.outlet.asked(), (Asked{"publish 0", "publish 1 checkpoint", "show 1", "write 1"}));
  run.wholeRound(2, 2);
  EXPECT_EQ(run.outlet.asked(), (Asked{"checkpoint 2", "publish 2", "show 2", "write 2"}));
  run.wholeRound(3, 3);
  EXPECT_EQ(run.outlet.asked(), (Asked{"publish 3", "show 3", "write 3"}));
  run.driver.end(GridRun::at(4));
  EXPECT_EQ(run.driver.askForCheckpoint().message, "the rounds are over: there is nothing to save");
}

TEST(RoundDriver, AnEvaluationIsOfTheNextMetaPolicyButNeverOfTheInitialOne) {
  GridRun run({"rounds:=2"});
  EXPECT_TRUE(run.driver.askForEvaluation().taken);
  run.begin(0);
  run.wholeRound(1, 1);
  EXPECT_EQ(run.outlet.asked(), (Asked{"publish 0", "publish 1 evaluate", "show 1", "write 1"}));
  run.reportAll(2);
  run.step(2);
  EXPECT_EQ(run.outlet.asked(), Asked{"publish 2"});
  const RoundDriver::Answer late = run.driver.askForEvaluation();
  EXPECT_FALSE(late.taken);
  EXPECT_EQ(late.message, "the last meta-policy is out, and is evaluated in any case");
}

TEST(RoundDriver, ATaskThatHasFailedForGoodEndsTheRunUnlessAQuorumIsLeft) {
  GridRun all;
  all.begin(0);
  all.driver.giveUp(1, "task 1 failed.");
  EXPECT_EQ(all.outlet.logged, std::vector<std::string>{"error: task 1 failed."});
  all.driver.giveUp(1, "task 1 failed.");
  EXPECT_EQ(all.outlet.logged.size(), 1u) << "told once";
  EXPECT_EQ(test::errorOf([&] { all.step(1); }), "task 1 failed.");

  GridRun two({"quorum:=2", "round_timeout:=30"});
  two.begin(0);
  two.driver.giveUp(1, "task 1 failed.");
  two.report(0, 1);
  two.report(2, 1);
  two.step(31);
  EXPECT_EQ(two.driver.round(), 1);
}

TEST(RoundDriver, ARunThatIsStoppedWritesTheRoundsThatAreClosed) {
  GridRun run;
  run.begin(0);
  run.reportAll(1);
  run.step(1);
  run.report(0, 2);
  run.outlet.disk_error = "the disk is full.";
  run.result(0, 1, PolicyKind::kMeta);
  EXPECT_FALSE(run.driver.end(GridRun::at(1.5)));
  run.outlet.asked();
  run.outlet.disk_error = "";
  EXPECT_FALSE(run.driver.end(GridRun::at(1.6)))
      << "it is tried at once, but there are more rounds";
  EXPECT_EQ(run.outlet.asked(), Asked{"write 1"});
  EXPECT_EQ(run.outlet.rounds.at(0).rows.size(), 4u) << "with what had come in";
}

TEST(RoundDriver, GoesOnFromAStateInItsMiddle) {
  GridRun run;
  run.begin(0);
  run.wholeRound(1, 1);
  run.reportAll(2);
  run.step(2);
  run.result(0, 2, PolicyKind::kMeta);
  const test::MemoryState state = test::stateOf(run.driver);

  GridRun other;
  test::load(other.driver, state);
  EXPECT_TRUE(test::stateOf(other.driver) == state);
  other.begin(100);
  EXPECT_EQ(other.outlet.asked(), Asked{"publish 2"});
  EXPECT_EQ(other.driver.roundInHand(), 3);
  EXPECT_FALSE(other.result(0, 2, PolicyKind::kMeta)) << "it is there";
  other.metaReturns(2);
  other.reportAll(3);
  other.step(103);
  EXPECT_EQ(other.outlet.asked(), (Asked{"show 2", "write 2", "publish 3"}));
  other.metaReturns(3);
  other.step(104);
  EXPECT_EQ(other.outlet.rounds.at(1).summary.seconds, 3);
}

}  // namespace
}  // namespace pmeta
