#include "pmeta_core/run/console.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::TempDir;
using test::writeFile;

// two training tasks, both policies, 100 environment steps a task and round
RoundBook::Round roundOf(int round, double personal, double meta, double seconds = 2) {
  RoundBook::Round done;
  done.summary.round = round;
  done.summary.rounds = 40;
  done.summary.personal_return = personal;
  done.summary.meta_return = meta;
  done.summary.test_return = std::numeric_limits<double>::quiet_NaN();
  done.summary.seconds = seconds;
  done.summary.eta_seconds = 65;
  for (const PolicyKind policy : {PolicyKind::kPersonal, PolicyKind::kMeta}) {
    for (int task = 0; task < 2; ++task) {
      RoundRow row;
      row.result.round = round;
      row.result.task = task;
      row.result.policy = policy;
      row.result.mean = (policy == PolicyKind::kPersonal ? personal : meta) + (task == 0 ? -1 : 1);
      row.env_steps = row.result.env_steps = 100 * round;
      done.rows.push_back(row);
    }
  }
  return done;
}

RoundBook::Round unevaluated(int round, double seconds = 2) {
  RoundBook::Round done = roundOf(round, 0, 0, seconds);
  done.rows.clear();
  return done;
}

Experiment twoTasks() { return gridExperiment({"sizes:=[4, 5]", "rounds:=40"}); }

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST(ProgressBar, FillsFromLeftToRight) {
  EXPECT_EQ(progressBar(0, 10, 10), "[          ]");
  EXPECT_EQ(progressBar(1, 10, 10), "[>         ]");
  EXPECT_EQ(progressBar(5, 10, 10), "[====>     ]");
  EXPECT_EQ(progressBar(999, 1000, 10), "[========> ]") << "full only when all is done";
  EXPECT_EQ(progressBar(10, 10, 10), "[==========]");
  EXPECT_EQ(progressBar(11, 10, 4), "[====]");
  EXPECT_EQ(progressBar(1000000, 1000000, 4000), "[" + std::string(4000, '=') + "]");
}

TEST(RunConsole, ATerminalHasALineWithABarForEveryEvaluatedRound) {
  RunConsole console(twoTasks(), true);
  EXPECT_EQ(console.take(roundOf(1, -3.5, -4.25)),
            "[                    ] round  1/40  PP -3.50  MP -4.25  100 steps/s  ETA 0:01:05");
  EXPECT_EQ(console.take(roundOf(20, -2, -3)).substr(0, 34), "[=========>          ] round 20/40");
  EXPECT_EQ(console.take(roundOf(40, -2, -3)).substr(0, 34), "[====================] round 40/40");
}

TEST(RunConsole, SpeedCountsTheRoundsBetweenEvaluationsToo) {
  RunConsole console(twoTasks(), true);
  EXPECT_EQ(console.take(unevaluated(1)), "");
  EXPECT_EQ(console.take(unevaluated(2, 5)), "");
  // 2 tasks x 300 steps in 2 + 5 + 3 seconds
  EXPECT_NE(console.take(roundOf(3, 0, 0, 3)).find("  60 steps/s"), std::string::npos);
  EXPECT_NE(console.take(roundOf(4, 0, 0, 1)).find("  200 steps/s"), std::string::npos);
}

TEST(RunConsole, WithoutATerminalARunHasTenLinesAndTheLastRoundIsOne) {
  RunConsole console(twoTasks(), false);
  std::vector<std::string> lines;
  for (int round = 1; round <= 40; ++round) {
    const std::string line = console.take(roundOf(round, round, -round, 2));
    if (!line.empty()) lines.push_back(line);
  }
  ASSERT_EQ(lines.size(), 10u);
  EXPECT_EQ(lines.front(), "round  4/40  PP 4.00  MP -4.00  100 steps/s  ETA 0:01:05");
  EXPECT_EQ(lines.back(), "round 40/40  PP 40.00  MP -40.00  100 steps/s  ETA 0:01:05");

  RunConsole few(gridExperiment({"sizes:=[4, 5]", "rounds:=3"}), false);
  for (int round = 1; round <= 3; ++round) EXPECT_NE(few.take(roundOf(round, 0, 0)), "");
}

TEST(RunConsole, TenSecondsOfRoundsWithoutALineBringOne) {
  for (const bool terminal : {false, true}) {
    RunConsole console(twoTasks(), terminal);
    std::string rounds;
    for (int round = 1; round <= 9; ++round) {
      const std::string line = console.take(unevaluated(round, round < 8 ? 4 : 60));
      if (!line.empty()) rounds += line.substr(line.find("round")) + "\n";
    }
    EXPECT_EQ(rounds,
              "round  3/40  ETA 0:01:05\nround  6/40  ETA 0:01:05\n"
              "round  8/40  ETA 0:01:05\nround  9/40  ETA 0:01:05\n");
  }
}

TEST(RunConsole, TheTableHasLastAndBestOfEveryTask) {
  RunConsole console(twoTasks(), false);
  EXPECT_EQ(console.table(), "") << "nothing is evaluated yet";
  console.take(roundOf(1, -3, -4));
  console.take(roundOf(2, -1, -6));
  console.take(roundOf(3, -2, -4));
  const std::vector<std::string> expected = {
      "task          PP last     PP best (round)    MP last     MP best (round)",
      "0 grid_4x4      -3.00       -2.00     (2)      -5.00       -5.00     (1)",
      "1 grid_5x5      -1.00        0.00     (2)      -3.00       -3.00     (1)",
      "mean            -2.00       -1.00     (2)      -4.00       -4.00     (1)"};
  EXPECT_EQ(linesOf(console.table()), expected);
}

TEST(RunConsole, TheTableShowsTestTasksAndAPolicyThatIsNotThere) {
  const Experiment experiment = Experiment::parse(R"(
experiment: point
rounds: 1
updates_per_round: 1
learner: sac
sac: {hidden: [4], batch_size: 4, warm_up_steps: 4, task_encoding: none}
environment: {name: sparse_point_robot, goal_angles: [0.5], test_goal_angles: [1.0, 2.0]}
)",
                                                  "point.yaml");
  RunConsole console(experiment, true);
  const LocalResult result = runLocally(experiment);
  const std::string line = console.take(result.rounds.at(0));
  EXPECT_NE(line.find("  test "), std::string::npos) << line;
  const std::vector<std::string> lines = linesOf(console.table());
  ASSERT_EQ(lines.size(), 6u);
  EXPECT_NE(lines[2].find("(test)"), std::string::npos) << lines[2];
  EXPECT_NE(lines[2].find(" - "), std::string::npos) << "a test task has no personal policy";
  EXPECT_EQ(lines[5].rfind("mean of test tasks", 0), 0u) << lines[5];
  for (const std::string& each : lines) EXPECT_EQ(each.size(), lines[0].size()) << each;
}

TEST(RunConsole, SaysOfARunWhatItsRecordSays) {
  const Experiment experiment = gridExperiment();
  RunConsole console(experiment, true);
  int lines = 0;
  const LocalResult result = runLocally(experiment, nullptr, [&](const RoundBook::Round& round) {
    lines += console.take(round).empty() ? 0 : 1;
    return true;
  });
  EXPECT_EQ(lines, 10);
  const RoundSummary& last = result.rounds.back().summary;
  char mean[64];
  std::snprintf(mean, sizeof mean, "%.2f", last.personal_return);
  const std::vector<std::string> table = linesOf(console.table());
  ASSERT_EQ(table.size(), 7u);
  EXPECT_NE(table.back().find(mean), std::string::npos) << table.back();
}

TEST(RunConsole, ARunThatGoesOnRemembersItsBestRounds) {
  const TempDir dir;
  const Experiment experiment = gridExperiment({"results_dir:=" + dir.path()});
  RunLog log(experiment);
  RunConsole watched(experiment, true);
  const LocalResult result = runLocally(experiment, &log, [&](const RoundBook::Round& round) {
    watched.take(round);
    return true;
  });
  RunConsole recalled(experiment, true);
  recalled.recall(log.dir() + "/rounds.csv");
  EXPECT_EQ(recalled.table(), watched.table());

  // a run that has nothing behind it
  writeFile(dir / "rounds.csv", std::string(RunLog::csvHeader()) + "\n");
  RunConsole fresh(experiment, true);
  fresh.recall(dir / "rounds.csv");
  EXPECT_EQ(fresh.table(), "");
  writeFile(dir / "rounds.csv",
            std::string(RunLog::csvHeader()) + "\n1,99,train,personal,0,-1,0,9,10,3,0.1\n");
  EXPECT_NE(errorOf([&] { fresh.recall(dir / "rounds.csv"); }).find("has a task 99"),
            std::string::npos);
}

TEST(ListRunFolder, NamesWhatIsThere) {
  const TempDir dir;
  const Experiment experiment = gridExperiment({"results_dir:=" + dir.path(), "rounds:=2"});
  RunLog log(experiment);
  runLocally(experiment, &log);
  log.finish("finished");
  const std::vector<std::string> lines = linesOf(listRunFolder(log.dir()));
  ASSERT_EQ(lines.size(), 6u);
  EXPECT_EQ(lines[0], "results in " + log.dir());
  EXPECT_EQ(lines[1].rfind("  config.yaml     ", 0), 0u) << lines[1];
  EXPECT_EQ(lines[2].rfind("  losses.csv      ", 0), 0u) << lines[2];
  EXPECT_EQ(lines[3].rfind("  manifest.json   ", 0), 0u) << lines[3];
  EXPECT_EQ(lines[4], "  policies/       12 files");
  EXPECT_EQ(lines[5].rfind("  rounds.csv      ", 0), 0u) << lines[5];
  EXPECT_EQ(lines[5].back(), 'B');
}

}  // namespace
}  // namespace pmeta
