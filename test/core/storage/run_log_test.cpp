#include "pmeta_core/storage/run_log.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "../support.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/storage/manifest.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::readFile;
using test::TempDir;
using test::writeFile;
using Tasks = std::vector<int>;

Experiment threeTasks(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(), {"sizes:=[2, 3, 4]", "rounds:=4"});
  return gridExperiment(overrides);
}

// numbers that name their round, task and policy
TaskReturn makeReturn(int round, int task, PolicyKind policy) {
  TaskReturn result;
  result.run_id = "run";
  result.task = task;
  result.round = round;
  result.policy = policy;
  result.mean = -100.0 * round - 10 * task - (policy == PolicyKind::kMeta ? 1 : 0);
  result.std = 0.1;
  result.episodes = 3;
  if (policy == PolicyKind::kPersonal) {
    result.env_steps = 1000 * round + task;
    result.updates = 3;
  }
  return result;
}

std::string csvOf(const std::vector<RoundBook::Round>& rounds) {
  std::string text;
  for (const auto& round : rounds) {
    for (const RoundRow& row : round.rows) text += RunLog::csvLine(row) + "\n";
  }
  return text;
}

void addAll(RoundBook& book, int round) {
  for (int task = 0; task < 3; ++task) {
    EXPECT_TRUE(book.add(makeReturn(round, task, PolicyKind::kPersonal)));
    EXPECT_TRUE(book.add(makeReturn(round, task, PolicyKind::kMeta)));
  }
}

TEST(RoundBook, GivesRowsByPolicyThenTaskWithCountersSummedOverRounds) {
  RoundBook book(threeTasks());
  addAll(book, 1);
  book.closeRound(1, {0, 1, 2}, {}, 2);
  addAll(book, 2);
  book.closeRound(2, {0, 1, 2}, {}, 4);
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 2u);
  EXPECT_EQ(csvOf(rounds),
            "1,0,train,personal,0,-100,0.1,3,1000,3,0.000000\n"
            "1,1,train,personal,0,-110,0.1,3,1001,3,0.000000\n"
            "1,2,train,personal,0,-120,0.1,3,1002,3,0.000000\n"
            "1,0,train,meta,0,-101,0.1,3,1000,3,0.000000\n"
            "1,1,train,meta,0,-111,0.1,3,1001,3,0.000000\n"
            "1,2,train,meta,0,-121,0.1,3,1002,3,0.000000\n"
            "2,0,train,personal,0,-200,0.1,3,3000,6,0.000000\n"
            "2,1,train,personal,0,-210,0.1,3,3002,6,0.000000\n"
            "2,2,train,personal,0,-220,0.1,3,3004,6,0.000000\n"
            "2,0,train,meta,0,-201,0.1,3,3000,6,0.000000\n"
            "2,1,train,meta,0,-211,0.1,3,3002,6,0.000000\n"
            "2,2,train,meta,0,-221,0.1,3,3004,6,0.000000\n");

  const RoundSummary& summary = rounds[1].summary;
  EXPECT_EQ(summary.run_id, "run");
  EXPECT_EQ(summary.round, 2);
  EXPECT_EQ(summary.rounds, 4);
  EXPECT_EQ(summary.personal_return, -210);
  EXPECT_EQ(summary.meta_return, -211);
  EXPECT_EQ(summary.participants, (Tasks{0, 1, 2}));
  EXPECT_EQ(summary.seconds, 4);
  EXPECT_EQ(rounds[0].summary.eta_seconds, 3 * 2);
  EXPECT_EQ(summary.eta_seconds, 2 * 3) << "two rounds left at three seconds each";
  EXPECT_EQ(book.roundsTaken(), 2);
}

// returns and closings of all rounds as events in any order; closings keep theirs
TEST(RoundBook, RecordDoesNotDependOnArrivalOrder) {
  const Experiment experiment = threeTasks();
  std::string expected;
  std::mt19937 random(1);
  for (int attempt = 0; attempt < 200; ++attempt) {
    struct Event {
      bool close;
      int round, task;
      PolicyKind policy;
    };
    std::vector<Event> events;
    for (int round = 1; round <= 4; ++round) {
      events.push_back({true, round, 0, PolicyKind::kMeta});
      for (int task = 0; task < 3; ++task) {
        events.push_back({false, round, task, PolicyKind::kPersonal});
        events.push_back({false, round, task, PolicyKind::kMeta});
      }
    }
    if (attempt > 0) std::shuffle(events.begin(), events.end(), random);

    RoundBook book(experiment);
    std::string record;
    std::vector<RoundSummary> summaries;
    int closed = 0;
    for (const Event& event : events) {
      if (event.close) {
        ++closed;
        book.closeRound(closed, {0, 1, 2}, {}, 1);
      } else {
        EXPECT_TRUE(book.add(makeReturn(event.round, event.task, event.policy)));
      }
      if (attempt % 2 == 0) continue;
      const auto rounds = book.take();
      record += csvOf(rounds);
      for (const auto& round : rounds) summaries.push_back(round.summary);
    }
    const auto rest = book.take();
    record += csvOf(rest);
    for (const auto& round : rest) summaries.push_back(round.summary);
    if (attempt == 0) expected = record;
    ASSERT_EQ(std::count(record.begin(), record.end(), '\n'), 24);
    ASSERT_EQ(record, expected);
    ASSERT_EQ(summaries.size(), 4u);
    EXPECT_EQ(summaries[3].personal_return, -410);
  }
}

TEST(RoundBook, TakesNoReturnOutsideTheSchedule) {
  RoundBook book(threeTasks());
  TaskReturn asked = makeReturn(1, 0, PolicyKind::kMeta);
  asked.scheduled = false;
  EXPECT_FALSE(book.add(asked));
  asked.scheduled = true;
  EXPECT_TRUE(book.add(asked)) << "nothing stood in its place";
}

TEST(RoundBook, WaitsForTheClosingAndForEveryReturn) {
  RoundBook book(threeTasks());
  addAll(book, 1);
  EXPECT_TRUE(book.take().empty()) << "not closed";
  EXPECT_TRUE(book.take(true).empty()) << "not closed, even by force";
  book.closeRound(1, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 1u);

  book.closeRound(2, {0, 1, 2}, {}, 1);
  for (int task = 0; task < 3; ++task) book.add(makeReturn(2, task, PolicyKind::kPersonal));
  book.add(makeReturn(2, 0, PolicyKind::kMeta));
  EXPECT_TRUE(book.take().empty());
  EXPECT_EQ(book.awaited(), (Tasks{1, 2}));
  book.add(makeReturn(2, 2, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{1});
  book.add(makeReturn(2, 1, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_EQ(book.take().size(), 1u);
}

TEST(RoundBook, LaterRoundsWaitForEarlierOnes) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 1, 2}, {}, 1);
  addAll(book, 2);
  book.closeRound(2, {0, 1, 2}, {}, 1);
  EXPECT_TRUE(book.take().empty());
  addAll(book, 1);
  EXPECT_EQ(book.take().size(), 2u);
}

TEST(RoundBook, RefusesDuplicatesAndStrangers) {
  RoundBook book(threeTasks());
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  TaskReturn again = makeReturn(1, 0, PolicyKind::kPersonal);
  again.mean = 7;
  EXPECT_FALSE(book.add(again));
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kMeta))) << "another policy is no duplicate";

  for (const auto& [round, task] :
       std::vector<std::pair<int, int>>{{1, -1}, {1, 3}, {0, 1}, {-1, 1}, {5, 1}}) {
    EXPECT_FALSE(book.add(makeReturn(round, task, PolicyKind::kPersonal))) << round << " " << task;
  }
  TaskReturn other = makeReturn(1, 1, PolicyKind::kPersonal);
  other.run_id = "other";
  EXPECT_FALSE(book.add(other));

  book.closeRound(1, {0, 1, 2}, {}, 1);
  for (int task = 1; task < 3; ++task) {
    book.add(makeReturn(1, task, PolicyKind::kPersonal));
    book.add(makeReturn(1, task, PolicyKind::kMeta));
  }
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows[0].result.mean, -100) << "the first one counts";
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal))) << "given out already";
}

TEST(RoundBook, DoesWithoutThePersonalReturnOfAMissingTask) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {1}, 1);
  for (const int task : {0, 2}) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  for (const int task : {0, 1}) book.add(makeReturn(1, task, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{2}) << "task 1's meta return is in, its personal one not due";
  EXPECT_TRUE(book.take().empty());
  book.add(makeReturn(1, 2, PolicyKind::kMeta));
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].summary.missing, Tasks{1});
  EXPECT_EQ(rounds[0].summary.personal_return, -110);
  EXPECT_EQ(rounds[0].summary.meta_return, -111);
  EXPECT_EQ(rounds[0].rows.size(), 5u);
}

TEST(RoundBook, WaitsForThePersonalReturnOfAnExcludedTask) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {}, 1, {1});
  for (int task = 0; task < 3; ++task) book.add(makeReturn(1, task, PolicyKind::kMeta));
  for (const int task : {0, 2}) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  EXPECT_EQ(book.awaited(), Tasks{1});
  EXPECT_TRUE(book.take().empty());
  book.add(makeReturn(1, 1, PolicyKind::kPersonal));
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].summary.excluded, Tasks{1});
  EXPECT_EQ(rounds[0].rows.size(), 6u);
}

TEST(RoundBook, ForcedRoundsComeOutAsTheyAre) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {1}, 1);
  book.add(makeReturn(1, 2, PolicyKind::kPersonal));
  book.add(makeReturn(2, 0, PolicyKind::kPersonal));
  const auto rounds = book.take(true);
  ASSERT_EQ(rounds.size(), 1u) << "round 2 is not closed";
  EXPECT_EQ(csvOf(rounds), "1,2,train,personal,0,-120,0.1,3,1002,3,0.000000\n");
  EXPECT_EQ(rounds[0].summary.personal_return, -120);
  EXPECT_TRUE(std::isnan(rounds[0].summary.meta_return));
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal))) << "too late";

  book.closeRound(2, {0}, {1, 2}, 1);
  const auto second = book.take(true);
  EXPECT_EQ(csvOf(second), "2,0,train,personal,0,-200,0.1,3,2000,3,0.000000\n");
}

TEST(RoundBook, RoundsThatDoNotEvaluateWaitForNoReturn) {
  RoundBook book(threeTasks({"evaluation_interval:=3"}));
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  EXPECT_TRUE(book.hasPersonal(1));
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_TRUE(book.take().empty()) << "not closed";
  book.closeRound(1, {0, 1, 2}, {}, 1);
  book.closeRound(2, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 2u);
  EXPECT_FALSE(book.hasPersonal(3));
  EXPECT_EQ(book.awaited(), (Tasks{0, 1, 2}));
  book.closeRound(3, {0, 1, 2}, {}, 1);
  EXPECT_TRUE(book.take().empty());
  addAll(book, 3);
  EXPECT_EQ(book.take().size(), 1u);
  EXPECT_FALSE(book.hasPersonal(4)) << "the last round evaluates";
}

TEST(RoundBook, TestTasksOweOnlyMetaReturnsForEachContext) {
  const Experiment experiment = Experiment::parse(
      "learner: sac\nenvironment: {name: half_cheetah_dir, directions: [-1], test_directions: "
      "[1]}\n"
      "sac: {hidden: [4], task_encoding: inference, exploration_episodes: [2, 5]}\n"
      "personal: {alpha: 0.001, eta: 0.01}\nrun_id: run\n",
      "test");
  ASSERT_EQ(experiment.totalTasks(), 2);
  RoundBook book(experiment);
  TaskReturn test = makeReturn(1, 1, PolicyKind::kMeta);
  EXPECT_FALSE(book.add(test)) << "task 1 is a test task";
  test.split = Split::kTest;
  test.context_episodes = 3;
  EXPECT_FALSE(book.add(test)) << "after 3 episodes nobody evaluates";
  EXPECT_TRUE(book.hasPersonal(1) == false);
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  EXPECT_TRUE(book.hasPersonal(1)) << "a test task has no personal policy";
  book.closeRound(1, {0}, {}, 1);
  for (const int context : {0, 2, 5}) {
    EXPECT_TRUE(book.take().empty());
    TaskReturn meta = makeReturn(1, 0, PolicyKind::kMeta);
    meta.context_episodes = test.context_episodes = context;
    meta.mean = context;
    test.mean = 10 * context;
    EXPECT_TRUE(book.add(meta));
    EXPECT_TRUE(book.add(test));
  }
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows.size(), 7u);
  EXPECT_EQ(rounds[0].summary.meta_return, 5) << "after the most exploration";
  EXPECT_EQ(rounds[0].summary.test_return, 50);
}

TEST(RoundBook, IndependentRunsHaveNoMetaReturns) {
  RoundBook book(threeTasks({"algorithm:=independent"}));
  book.closeRound(1, {0, 1, 2}, {}, 1);
  for (int task = 0; task < 3; ++task) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  EXPECT_EQ(book.awaited(), Tasks{});
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows.size(), 3u);
  EXPECT_TRUE(std::isnan(rounds[0].summary.meta_return));
}

TEST(RoundBook, AwaitsNobodyOnceTheRunIsOver) {
  RoundBook book(threeTasks({"rounds:=1"}));
  EXPECT_EQ(book.awaited(), (Tasks{0, 1, 2}));
  addAll(book, 1);
  book.closeRound(1, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 1u);
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_TRUE(book.take(true).empty());
}

TEST(RunLog, WritesOneLineAReturn) {
  RoundRow row;
  row.result = makeReturn(3, 1, PolicyKind::kMeta);
  row.result.mean = -1.0 / 3;
  row.result.std = 1e-300;
  row.result.split = Split::kTest;
  row.result.seconds = 0.12345649;
  row.env_steps = 12345678901;
  row.updates = 9;
  EXPECT_EQ(RunLog::csvLine(row),
            "3,1,test,meta,0,-0.3333333333333333,1e-300,3,12345678901,9,0.123456");
  EXPECT_STREQ(
      RunLog::csvHeader(),
      "round,task,split,policy,context_episodes,return_mean,return_std,episodes,env_steps,updates,"
      "wall_s");
}

// what a folder holds, by name
std::vector<std::string> namesIn(const std::string& dir) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(dir)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST(RunLog, KeepsConfigManifestAndRounds) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path(), "seed:=7"});
  RunLog log(experiment);
  EXPECT_EQ(log.dir(), dir / "grid/run");
  EXPECT_EQ(namesIn(log.dir()),
            (std::vector<std::string>{"config.yaml", "lock", "manifest.json", "rounds.csv"}));
  EXPECT_EQ(readFile(log.dir() + "/config.yaml"), experiment.yaml());
  EXPECT_EQ(Experiment::load(log.dir() + "/config.yaml").yaml(), experiment.yaml());
  EXPECT_EQ(runStatus(log.dir()), "running");
  EXPECT_EQ(readFile(log.dir() + "/rounds.csv"), std::string(RunLog::csvHeader()) + "\n");

  RoundBook book(experiment);
  std::string lines = std::string(RunLog::csvHeader()) + "\n";
  for (int round = 1; round <= 2; ++round) {
    addAll(book, round);
    book.closeRound(round, {0, 1, 2}, {}, 1);
    const auto rounds = book.take();
    log.write(rounds.at(0));
    lines += csvOf(rounds);
    EXPECT_EQ(readFile(log.dir() + "/rounds.csv"), lines) << "on disk after each round";
  }
  log.finish("stopped");
  EXPECT_EQ(runStatus(log.dir()), "stopped");
  EXPECT_EQ(namesIn(log.dir()),
            (std::vector<std::string>{"config.yaml", "manifest.json", "rounds.csv"}));
}

TEST(RunLog, ManifestTellsWhatRan) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path(), "seed:=7"});
  RunLog log(experiment);
  auto manifest = nlohmann::json::parse(readFile(log.dir() + "/manifest.json"));
  EXPECT_EQ(manifest.at("status"), "running");
  EXPECT_TRUE(manifest.at("ended").is_null());
  EXPECT_EQ(manifest.at("rounds_done"), 0);

  RoundBook::Round round;
  round.summary.round = 1;
  log.write(round);
  log.finish("finished");
  manifest = nlohmann::json::parse(readFile(log.dir() + "/manifest.json"));
  EXPECT_EQ(manifest.at("experiment"), "grid");
  EXPECT_EQ(manifest.at("run_id"), "run");
  EXPECT_EQ(manifest.at("algorithm"), "pmeta");
  EXPECT_EQ(manifest.at("seed"), 7);
  EXPECT_EQ(manifest.at("status"), "finished");
  EXPECT_EQ(manifest.at("rounds_done"), 1);
  EXPECT_EQ(manifest.at("rounds"), 4);
  EXPECT_EQ(manifest.at("started").get<std::string>().size(), 20u);
  EXPECT_EQ(manifest.at("ended").get<std::string>().size(), 20u);
  EXPECT_EQ(manifest.at("commit"), commit());
  EXPECT_EQ(manifest.at("versions").at("zlib"), versions().at("zlib"));
  ASSERT_EQ(manifest.at("tasks").size(), 3u);
  const auto& task = manifest["tasks"][1];
  EXPECT_EQ(task.at("task"), 1);
  EXPECT_EQ(task.at("split"), "train");
  EXPECT_EQ(task.at("name"), "grid_3x3");
  EXPECT_EQ(task.at("description"), "3x3 cells, landmark at row 2, column 2");
}

nlohmann::json manifestWith(std::vector<std::string> overrides) {
  const TempDir dir;
  overrides.push_back("results_dir:=" + dir.path());
  return nlohmann::json::parse(constantManifest(threeTasks(overrides), "now"));
}

TEST(Manifest, HoldsWhatDefinesTheRun) {
  const Experiment experiment = threeTasks({"lambda:=7", "pace:=2", "checkpoint.interval:=3"});
  const auto manifest = nlohmann::json::parse(constantManifest(experiment, "now"));
  const auto& settings = manifest.at("defining_settings");
  EXPECT_EQ(settings, nlohmann::json(experiment.definingSettings()));
  EXPECT_EQ(settings.at("personal.lambda"), "7");
  EXPECT_EQ(settings.at("environment.sizes"), "[2, 3, 4]");
  EXPECT_FALSE(settings.contains("pace"));
  EXPECT_FALSE(settings.contains("checkpoint.interval"));
}

TEST(Manifest, SaysWhatFiguresMustKnow) {
  const auto pmeta = manifestWith({}).at("figures");
  EXPECT_EQ(pmeta.at("label"), "pMeta-RL");
  EXPECT_EQ(pmeta.at("baseline"), false);
  EXPECT_EQ(pmeta.at("policies"), "table");
  EXPECT_EQ(pmeta.at("fixed_settings"), nlohmann::json::array());
  EXPECT_EQ(pmeta.at("curves").size(), 2u);
  EXPECT_EQ(pmeta["curves"][1].dump(), R"({"context_episodes":0,"policy":"meta","split":"train"})");

  const auto alone = manifestWith({"algorithm:=independent"}).at("figures");
  EXPECT_EQ(alone.at("baseline"), true);
  EXPECT_EQ(alone.at("compared_by"), "personal");
  EXPECT_EQ(alone.at("curves").size(), 1u);
  const std::vector<std::string> fixed = alone.at("fixed_settings");
  for (const char* key : {"personal.lambda", "personal.eta", "aggregation.rule"}) {
    EXPECT_EQ(std::count(fixed.begin(), fixed.end(), key), 1) << key;
  }
  EXPECT_EQ(std::count(fixed.begin(), fixed.end(), "personal.alpha"), 0);
}

TEST(RunLog, AFailureStandsInTheManifestWithItsReason) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path()});
  RunLog log(experiment);
  log.fail("a reason with a byte \xff that is no text.");
  const auto manifest = nlohmann::json::parse(readFile(log.dir() + "/manifest.json"));
  EXPECT_EQ(manifest.at("status"), "failed");
  EXPECT_EQ(manifest.at("reason"), "a reason with a byte \xEF\xBF\xBD that is no text.");
  EXPECT_TRUE(manifest.at("ended").is_string());
  EXPECT_EQ(manifest.at("pid"), ::getpid());
  EXPECT_EQ(manifest.at("host"), hostName());
  // nothing to write to: the error that is on its way is not replaced
  std::filesystem::remove_all(log.dir());
  log.fail("gone");
}

TEST(RunLog, TheManifestCountsRoundsWhileTheRunGoesOn) {
  const TempDir dir;
  RunLog log(threeTasks({"results_dir:=" + dir.path()}));
  const auto roundsDone = [&] {
    return nlohmann::json::parse(readFile(log.dir() + "/manifest.json")).at("rounds_done");
  };
  RoundBook::Round round;
  // at most once a second, so that quick rounds cost nothing
  for (round.summary.round = 1; roundsDone() == 0; ++round.summary.round) log.write(round);
  EXPECT_EQ(roundsDone(), round.summary.round - 1);
}

TEST(RunLog, AnExistingRunIsRefusedAndUntouched) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path()});
  std::string folder;
  {
    RunLog log(experiment);
    log.finish("finished");
    folder = log.dir();
  }
  const std::string manifest = readFile(folder + "/manifest.json");
  EXPECT_EQ(errorOf([&] { RunLog log(experiment); }),
            "the run folder " + folder + " already holds a run: choose another run_id.");
  EXPECT_EQ(readFile(folder + "/manifest.json"), manifest);
  EXPECT_EQ(namesIn(folder),
            (std::vector<std::string>{"config.yaml", "manifest.json", "rounds.csv"}));
}

TEST(RunLog, AnUnwritableFolderIsRefused) {
  const TempDir dir;
  writeFile(dir / "file", "x");
  const Experiment experiment = threeTasks({"results_dir:=" + (dir / "file/results")});
  EXPECT_EQ(errorOf([&] { RunLog log(experiment); }),
            "the results folder " + (dir / "file/results") +
                " cannot be written (Not a directory): choose another with results_dir:=DIR.");
  EXPECT_EQ(readFile(dir / "file"), "x");
  EXPECT_EQ(namesIn(dir.path()), std::vector<std::string>{"file"});
}

TEST(RunStatus, IsEmptyWithoutAManifest) {
  const TempDir dir;
  EXPECT_EQ(runStatus(dir / "nowhere"), "");
  EXPECT_EQ(runStatus(dir.path()), "");
  for (const std::string text : {"", "{", "[]", "{}", "{\"status\": 3}"}) {
    writeFile(dir / "manifest.json", text);
    EXPECT_EQ(runStatus(dir.path()), "") << text;
  }
  writeFile(dir / "manifest.json", "{\"status\": \"failed\"}");
  EXPECT_EQ(runStatus(dir.path()), "failed");
}

TEST(WriteFileAtomically, ReplacesTheFileAndLeavesNothingElse) {
  const TempDir dir;
  writeFile(dir / "a", "a long old text");
  writeFileAtomically(dir / "a", "new\n");
  EXPECT_EQ(readFile(dir / "a"), "new\n");
  EXPECT_EQ(namesIn(dir.path()), std::vector<std::string>{"a"});
}

TEST(WriteFileAtomically, FailsWithASentenceAndLeavesNothing) {
  const TempDir dir;
  EXPECT_EQ(errorOf([&] { writeFileAtomically(dir / "none/a", "x"); }),
            "cannot write " + (dir / "none/a") + " (No such file or directory).");
  std::filesystem::create_directories(dir / "full/below");
  EXPECT_EQ(errorOf([&] { writeFileAtomically(dir / "full", "x"); }),
            "cannot write " + (dir / "full") + " (Is a directory).");
  EXPECT_EQ(namesIn(dir.path()), std::vector<std::string>{"full"});
}

TEST(RoundBook, RefusesWhatIsNoResult) {
  const Experiment experiment = threeTasks();
  RoundBook book(experiment);
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  const std::vector<std::function<void(TaskReturn&)>> spoilers = {
      [](TaskReturn& r) { r.mean = std::nan(""); },
      [](TaskReturn& r) { r.mean = -HUGE_VAL; },
      [](TaskReturn& r) { r.mean = 1e200; },
      [](TaskReturn& r) { r.std = HUGE_VAL; },
      [](TaskReturn& r) { r.std = -1; },
      [](TaskReturn& r) { r.seconds = 1e308; },
      [](TaskReturn& r) { r.seconds = -1; },
      [](TaskReturn& r) { r.episodes = 0; },
      [](TaskReturn& r) { r.env_steps = -500000; },
      [](TaskReturn& r) { r.env_steps = kHuge; },
      [](TaskReturn& r) { r.updates = kHuge; },
      [](TaskReturn& r) { r.broken_episodes = -1; }};
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    TaskReturn spoiled = makeReturn(2, 1, PolicyKind::kPersonal);
    spoilers[i](spoiled);
    EXPECT_EQ(errorOf([&] {
                book.add(spoiled);
              }).rfind("the return of task 1 in round 2 is no result: ", 0),
              0u)
        << i;
  }
  EXPECT_TRUE(book.add(makeReturn(2, 1, PolicyKind::kPersonal))) << "its place is still free";
  EXPECT_FALSE(book.add(makeReturn(2, 1, PolicyKind::kPersonal)))
      << "a duplicate is none the less one";
}

TEST(RoundBook, CountersThatOverflowOnlyWhenTheyAreSummedAreRefused) {
  const Experiment experiment = threeTasks();
  RoundBook book(experiment);
  TaskReturn large = makeReturn(1, 0, PolicyKind::kPersonal);
  large.env_steps = kMostCounted - 10;
  EXPECT_TRUE(book.add(large));
  TaskReturn more = makeReturn(2, 0, PolicyKind::kPersonal);
  more.env_steps = 11;
  EXPECT_THROW(book.add(more), Error);
  more.env_steps = 10;
  EXPECT_TRUE(book.add(more));
}

TEST(RunLog, CountsEpisodesThatBrokeDownAndSaysWhyARunFailed) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path()});
  const auto manifest = [&] {
    return nlohmann::json::parse(readFile(experiment.runDir() + "/manifest.json"));
  };
  RoundBook book(experiment);
  RunLog log(experiment);
  EXPECT_EQ(manifest()["broken_episodes"], 0);
  for (int round = 1; round <= 2; ++round) {
    for (int task = 0; task < 3; ++task) {
      TaskReturn personal = makeReturn(round, task, PolicyKind::kPersonal);
      personal.broken_episodes = task;
      book.add(personal);
      book.add(makeReturn(round, task, PolicyKind::kMeta));
    }
    book.closeRound(round, {0, 1, 2}, {}, 1);
  }
  for (const auto& round : book.take()) log.write(round);
  log.fail("task 1 failed.");
  EXPECT_EQ(manifest()["broken_episodes"], 6);
  EXPECT_EQ(manifest()["status"], "failed");
  EXPECT_EQ(manifest()["reason"], "task 1 failed.");
}

}  // namespace
}  // namespace pmeta
