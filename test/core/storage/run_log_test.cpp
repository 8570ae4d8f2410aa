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
#include "three_tasks.h"

namespace pmeta {
namespace {

using test::addAll;
using test::csvOf;
using test::errorOf;
using test::makeReturn;
using test::readFile;
using test::TempDir;
using test::threeTasks;
using test::writeFile;

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
  EXPECT_EQ(namesIn(log.dir()), (std::vector<std::string>{"config.yaml", "lock", "losses.csv",
                                                          "manifest.json", "rounds.csv"}));
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
            (std::vector<std::string>{"config.yaml", "losses.csv", "manifest.json", "rounds.csv"}));
}

TEST(RunLog, KeepsEveryLossByItsName) {
  const TempDir dir;
  const Experiment experiment = threeTasks({"results_dir:=" + dir.path()});
  RunLog log(experiment);
  RoundBook::Round round;
  round.summary.round = 4;
  for (const PolicyKind policy : {PolicyKind::kPersonal, PolicyKind::kMeta}) {
    round.rows.emplace_back();
    round.rows.back().result = makeReturn(4, 2, policy);
  }
  round.rows.front().result.losses = {{"critic", 0.25}, {"entropy", std::nan("")}};
  log.write(round);
  EXPECT_EQ(readFile(log.dir() + "/losses.csv"),
            "round,task,loss,value\n4,2,critic,0.25\n4,2,entropy,nan\n");
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
            (std::vector<std::string>{"config.yaml", "losses.csv", "manifest.json", "rounds.csv"}));
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
