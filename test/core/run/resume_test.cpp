#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <stdexcept>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"
#include "pmeta_core/storage/checkpoint.h"
#include "pmeta_core/storage/policy_file.h"
#include "storage/checkpoint_experiments.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;
using test::checkpointExperiment;
using test::checkpointKinds;
using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;

// a run's files without the wall times
struct Record {
  std::string rounds, losses, fresh;
  std::uint32_t meta = 0;
  std::vector<std::uint32_t> personal;

  bool operator==(const Record& other) const {
    return rounds == other.rounds && losses == other.losses && fresh == other.fresh &&
           meta == other.meta && personal == other.personal;
  }
};

Record recordOf(const Experiment& experiment) {
  const std::string dir = experiment.runDir();
  Record record;
  record.rounds = std::regex_replace(readFile(dir + "/rounds.csv"), std::regex(",[^,\n]*\n"), "\n");
  record.losses = readFile(dir + "/losses.csv");
  if (fs::exists(dir + "/final.csv")) record.fresh = readFile(dir + "/final.csv");
  record.meta = loadPolicy(dir + "/policies/meta.safetensors").model.checksum();
  for (int task = 0; task < experiment.numTasks(); ++task) {
    record.personal.push_back(
        loadPolicy(dir + "/policies/task_" + std::to_string(task) + ".safetensors")
            .model.checksum());
  }
  return record;
}

void finish(const Experiment& experiment) {
  RunLog log(experiment);
  runLocally(experiment, &log);
  log.finish("finished");
}

// ends in the middle of things, as a crash does
void runUntilCrash(const Experiment& experiment, int round) {
  RunLog log(experiment);
  EXPECT_THROW(runLocally(experiment, &log,
                          [&](const RoundBook::Round& done) -> bool {
                            if (done.summary.round == round) throw std::runtime_error("crash");
                            return true;
                          }),
               std::runtime_error);
}

void runUntilStopped(const Experiment& experiment, int round) {
  RunLog log(experiment);
  const LocalResult result = runLocally(
      experiment, &log, [&](const RoundBook::Round& done) { return done.summary.round < round; });
  EXPECT_TRUE(result.stopped);
  log.finish("stopped");
}

// goes on to the end, or to `round`; gives the round of the checkpoints
int resume(const Experiment& before, int round = 0) {
  const Experiment experiment = Experiment::resume(before.runDir());
  const ResumePoint point = findResumePoint(experiment);
  RunLog log = RunLog::reopen(experiment, point.rounds_done);
  const LocalResult result = runLocally(
      experiment, &log,
      [&](const RoundBook::Round& done) { return round == 0 || done.summary.round < round; },
      point.round);
  log.finish(result.stopped ? "stopped" : "finished");
  return point.round;
}

nlohmann::json manifestOf(const Experiment& experiment) {
  return nlohmann::json::parse(readFile(experiment.runDir() + "/manifest.json"));
}

TEST(Resume, EqualsARunWithoutInterruptionBitForBit) {
  for (const std::string& kind : checkpointKinds()) {
    const TempDir dir;
    const Experiment whole = checkpointExperiment(kind, dir / "whole", {"checkpoint.interval:=0"});
    finish(whole);
    const Record expected = recordOf(whole);
    for (const int round : {2, 3, 6}) {
      const Experiment killed = checkpointExperiment(kind, dir / std::to_string(round));
      runUntilCrash(killed, round);
      EXPECT_EQ(resume(killed), round);
      EXPECT_TRUE(recordOf(killed) == expected) << kind << ", killed in round " << round;
    }
  }
}

TEST(Resume, GoesOnFromWhereARunWasStopped) {
  for (const std::string& kind : checkpointKinds()) {
    const TempDir dir;
    const Experiment whole = checkpointExperiment(kind, dir / "whole", {"checkpoint.interval:=0"});
    finish(whole);
    // several times, and between two checkpoints
    const Experiment parts = checkpointExperiment(kind, dir / "parts", {"checkpoint.interval:=4"});
    runUntilStopped(parts, 1);
    EXPECT_EQ(runStatus(parts.runDir()), "stopped");
    EXPECT_EQ(resume(parts, 3), 1);
    EXPECT_EQ(resume(parts), 3);
    EXPECT_EQ(runStatus(parts.runDir()), "finished");
    EXPECT_TRUE(recordOf(parts) == recordOf(whole)) << kind;
  }
}

TEST(Resume, GoesOnFromTheNewestRoundThatAllPartiesHave) {
  const TempDir dir;
  const Experiment whole = checkpointExperiment("table", dir / "whole");
  finish(whole);
  const Experiment experiment = checkpointExperiment("table", dir / "killed");
  runUntilCrash(experiment, 5);
  const std::string folder = experiment.runDir() + "/checkpoint/";
  // one agent's newest is damaged
  const std::string text = readFile(folder + "task_1.round_5.h5");
  writeFile(folder + "task_1.round_5.h5", text.substr(0, text.size() / 2));
  const ResumePoint point = findResumePoint(experiment);
  EXPECT_EQ(point.round, 4);
  EXPECT_EQ(point.rounds_done, 3);
  ASSERT_EQ(point.refused.size(), 1u);
  EXPECT_NE(point.refused[0].find("task_1.round_5.h5"), std::string::npos);
  EXPECT_EQ(resume(experiment), 4);
  EXPECT_TRUE(recordOf(experiment) == recordOf(whole));

  // killed before the aggregator wrote: it is one behind
  const Experiment late = checkpointExperiment("table", dir / "late");
  runUntilCrash(late, 5);
  fs::remove(late.runDir() + "/checkpoint/aggregator.round_5.h5");
  EXPECT_EQ(resume(late), 4);
  EXPECT_TRUE(recordOf(late) == recordOf(whole));
}

TEST(Resume, CutsTheRecordBackToWhatTheCheckpointKnows) {
  const TempDir dir;
  const Experiment whole = checkpointExperiment("table", dir / "whole");
  finish(whole);
  const Experiment experiment = checkpointExperiment("table", dir / "killed");
  runUntilCrash(experiment, 3);
  const std::string csv = experiment.runDir() + "/rounds.csv";
  writeFile(csv, readFile(csv) + "4,0,train,personal,0,-1,0,9,10,3,0.1\n4,1,tra");
  const std::string losses = experiment.runDir() + "/losses.csv";
  writeFile(losses, readFile(losses) + "4,0,td,1\n4,1,t");
  resume(experiment);
  EXPECT_TRUE(recordOf(experiment) == recordOf(whole));

  const Experiment lost = checkpointExperiment("table", dir / "lost");
  runUntilCrash(lost, 4);
  const std::string altered = lost.runDir() + "/losses.csv";
  const std::string good = readFile(altered);
  writeFile(altered, "round,task,loss,value\nx,0,td,1\n");
  EXPECT_EQ(errorOf([&] { RunLog::reopen(lost, 3); }),
            altered + " line 2 is 'x,0,td,1', which no run writes: it has been altered.");
  writeFile(altered, good);
  const std::string path = lost.runDir() + "/rounds.csv";
  writeFile(path, std::string(RunLog::csvHeader()) + "\n");
  EXPECT_EQ(errorOf([&] { RunLog::reopen(lost, 3); }),
            path +
                " ends with round 0 but the checkpoint knows 2 rounds: the run cannot be "
                "resumed.");
  writeFile(path, "another header\n");
  EXPECT_EQ(errorOf([&] { RunLog::reopen(lost, 3); }),
            path + " begins with 'another header' but must begin with '" + RunLog::csvHeader() +
                "': it has been altered, or is of another version.");
  std::filesystem::remove(path);
  EXPECT_NE(errorOf([&] { RunLog::reopen(lost, 3); }).find("(No such file or directory)"),
            std::string::npos);
}

TEST(Resume, TakesATableThatASpreadsheetHasSaved) {
  const TempDir dir;
  const Experiment whole = checkpointExperiment("table", dir / "whole");
  finish(whole);
  const Experiment experiment = checkpointExperiment("table", dir / "killed");
  runUntilCrash(experiment, 3);
  const std::string csv = experiment.runDir() + "/rounds.csv";
  const std::string lines = std::regex_replace(readFile(csv), std::regex("\n"), "\r\n");
  writeFile(csv, "\xEF\xBB\xBF" + lines + "\r\n\n");
  resume(experiment);
  EXPECT_TRUE(recordOf(experiment) == recordOf(whole));

  const Experiment quoted = checkpointExperiment("table", dir / "quoted");
  runUntilCrash(quoted, 3);
  const std::string path = quoted.runDir() + "/rounds.csv";
  writeFile(path, std::string(RunLog::csvHeader()) + "\n\"1\",\"0\"\n");
  EXPECT_EQ(errorOf([&] { RunLog::reopen(quoted, 3); }),
            path + " line 2 is '\"1\",\"0\"', which no run writes: it has been altered.");
}

TEST(Resume, ThroughALinkToTheRunFolder) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir / "runs");
  runUntilStopped(experiment, 3);
  std::filesystem::create_directory_symlink(experiment.runDir(), dir / "link");
  EXPECT_EQ(Experiment::resume(dir / "link").settingsHash(), experiment.settingsHash());
  EXPECT_EQ(Experiment::resume(dir / "link/").runDir(), experiment.runDir());
}

TEST(Resume, TheManifestKeepsTheStart) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  runUntilStopped(experiment, 3);
  nlohmann::json manifest = manifestOf(experiment);
  manifest["started"] = "2020-01-01T00:00:00Z";
  writeFile(experiment.runDir() + "/manifest.json", manifest.dump());
  RunLog log = RunLog::reopen(experiment, 3);
  EXPECT_EQ(manifestOf(experiment)["status"], "running");
  EXPECT_EQ(manifestOf(experiment)["started"], "2020-01-01T00:00:00Z");
  EXPECT_EQ(manifestOf(experiment)["rounds_done"], 3);
  EXPECT_TRUE(manifestOf(experiment)["ended"].is_null());
}

TEST(Resume, RefusesWhatCannotGoOn) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  const std::string run = experiment.runDir();
  EXPECT_EQ(errorOf([&] { Experiment::resume(run); }),
            "there is no run to resume in " + run + ": it has no config.yaml.");
  EXPECT_EQ(errorOf([&] { findResumePoint(experiment); }),
            "there is no run to resume in " + run + ": it has no manifest.json.");
  finish(experiment);
  EXPECT_EQ(errorOf([&] { findResumePoint(experiment); }),
            "the run in " + run + " is finished: there is nothing to resume.");
  EXPECT_EQ(errorOf([&] { RunLog::reopen(experiment, 6); }),
            "the run in " + run + " is finished: there is nothing to resume.");
  const Experiment without =
      checkpointExperiment("table", dir / "without", {"checkpoint.interval:=0"});
  runUntilCrash(without, 3);
  EXPECT_FALSE(fs::exists(without.runDir() + "/checkpoint"));
  EXPECT_EQ(errorOf([&] { findResumePoint(without); }),
            "there is no round of which all parties have a good checkpoint in " + without.runDir() +
                ": begin a new run.");
}

TEST(Resume, TakesOnlySettingsThatDoNotDefineTheRun) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir / "first");
  runUntilStopped(experiment, 2);
  const std::string run = experiment.runDir();
  const Experiment resumed =
      Experiment::resume(run + "/", {"pace:=2", "publish_trajectories:=false",
                                     "checkpoint.interval:=3", "round_timeout:=7", "lambda:=10"});
  EXPECT_EQ(resumed.settings().pace, 2);
  EXPECT_EQ(resumed.settings().checkpoint_interval, 3);
  EXPECT_EQ(resumed.definingSettings(), experiment.definingSettings());
  EXPECT_EQ(errorOf([&] { Experiment::resume(run, {"lambda:=5"}); }),
            "personal.lambda cannot be changed in a run that goes on: resume " + run +
                " without it, or begin a new run.");
  EXPECT_NE(errorOf([&] { Experiment::resume(run, {"run_id:=other"}); }).find("run_id cannot be"),
            std::string::npos);

  // the folder may have been moved, but not renamed
  fs::create_directories(dir / "second");
  fs::rename(dir / "first/table", dir / "second/table");
  EXPECT_EQ(Experiment::resume(dir / "second/table/run").runDir(), dir / "second/table/run");
  fs::rename(dir / "second/table/run", dir / "second/table/walk");
  EXPECT_EQ(errorOf([&] { Experiment::resume(dir / "second/table/walk"); }),
            "the run folder " + (dir / "second/table/walk") +
                " must be <results_dir>/table/run, as its config.yaml names it.");
}

TEST(Resume, WhatDefinesTheRunStandsInItsManifest) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  runUntilStopped(experiment, 2);
  const std::string run = experiment.runDir();
  writeFile(run + "/config.yaml",
            Experiment::parse(experiment.yaml(), "", {"personal.alpha:=0.01"}).yaml());
  EXPECT_EQ(errorOf([&] { Experiment::resume(run); }),
            "personal.alpha cannot be changed in a run that goes on: resume " + run +
                " without it, or begin a new run.");
  nlohmann::json manifest = manifestOf(experiment);
  manifest["defining_settings"]["seed"] = 3;
  writeFile(run + "/manifest.json", manifest.dump());
  EXPECT_EQ(errorOf([&] { Experiment::resume(run); }),
            run +
                "/manifest.json must hold a text for each of its defining_settings: it has been "
                "altered.");

  // those of older runs do not say it
  writeFile(run + "/config.yaml", experiment.yaml());
  manifest.erase("defining_settings");
  writeFile(run + "/manifest.json", manifest.dump());
  EXPECT_EQ(Experiment::resume(run).definingSettings(), experiment.definingSettings());
  EXPECT_NE(errorOf([&] { Experiment::resume(run, {"lambda:=5"}); }).find("lambda cannot be"),
            std::string::npos);
}

TEST(Resume, WhatThereWasNoSettingOfHasItsDefault) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  runUntilStopped(experiment, 3);
  nlohmann::json manifest = manifestOf(experiment);
  ASSERT_EQ(manifest["defining_settings"].erase("aggregation.outlier_factor"), 1u);
  writeFile(experiment.runDir() + "/manifest.json", manifest.dump());
  EXPECT_EQ(Experiment::definingSettingsOf(experiment.runDir()), experiment.definingSettings());
}

TEST(Resume, ACheckpointThatCannotBeWrittenStopsTheRunInOneSentence) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  RunLog log(experiment);
  writeFile(experiment.runDir() + "/checkpoint", "a file where the folder should be");
  EXPECT_NE(errorOf([&] { runLocally(experiment, &log); }).find("cannot be made"),
            std::string::npos);
}

// a whole file, of this run, with a state that cannot be one
struct Nonsense {
  void saveState(StateWriter& writer) const { writer.count("round", 5); }
  void loadState(StateReader&) {}
};

TEST(Resume, AStateThatDoesNotLoadFallsBackToTheOneBefore) {
  const TempDir dir;
  const Experiment whole = checkpointExperiment("table", dir / "whole", {"checkpoint.interval:=0"});
  finish(whole);
  for (const int task : {kAggregator, 0}) {
    const Experiment killed = checkpointExperiment("table", dir / std::to_string(task));
    runUntilCrash(killed, 5);
    const CheckpointFolder folder(killed, task, TaskAgent(killed, std::max(task, 0)).layout());
    folder.save(5, Nonsense());
    EXPECT_EQ(resume(killed), 4);
    EXPECT_TRUE(recordOf(killed) == recordOf(whole));
  }
}

TEST(Resume, APartyLoadsTheNewestStateThatCanBeLoaded) {
  const TempDir dir;
  const Experiment killed = checkpointExperiment("table", dir.path());
  runUntilCrash(killed, 5);
  TaskAgent agent(killed, 0);
  const CheckpointFolder folder(killed, 0, agent.layout());
  folder.save(5, Nonsense());
  int made = 0;
  const auto fresh = [&]() -> TaskAgent& {
    ++made;
    agent = TaskAgent(killed, 0);
    return agent;
  };
  std::vector<std::string> refused;
  EXPECT_EQ(folder.loadNewest(6, fresh, refused), 4);
  EXPECT_EQ(agent.round(), 4);
  EXPECT_EQ(made, 2);
  EXPECT_EQ(refused.size(), 1u);

  folder.save(4, Nonsense());
  folder.save(5, Nonsense());
  EXPECT_EQ(folder.loadNewest(6, fresh, refused), 0);
  EXPECT_EQ(agent.round(), 0) << "as before round 1";
}

}  // namespace
}  // namespace pmeta
