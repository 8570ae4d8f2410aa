#include "pmeta_core/run/sweep.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <stdexcept>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"
#include "storage/checkpoint_experiments.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;
using test::checkpointKinds;
using test::checkpointYaml;
using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;

class SweepResume : public ::testing::TestWithParam<std::string> {
 protected:
  SweepResume() {
    writeFile(dir_.path() + "/experiment.yaml", checkpointYaml(GetParam()));
    plan_.config = dir_.path() + "/experiment.yaml";
    plan_.assignments = {"seed:=3-4", "results_dir:=" + dir_.path()};
    plan_.name = "cut_off";
    plan_.resume = true;
  }

  // the first run, until a round has been recorded; its first line is marked
  std::string cutOff(int round) {
    const Experiment first = planSweep(plan_).front();
    {
      RunLog log(first);
      const auto crash = [&](const RoundBook::Round& done) -> bool {
        if (done.summary.round == round) throw std::runtime_error("crash");
        return true;
      };
      EXPECT_THROW(runLocally(first, &log, crash), std::runtime_error);
    }
    const std::string path = first.runDir() + "/rounds.csv";
    writeFile(path, std::regex_replace(readFile(path), std::regex(",[0-9.]+\n"), ",77.000000\n",
                                       std::regex_constants::format_first_only));
    return path;
  }

  static std::string withoutTimes(const std::string& path) {
    return std::regex_replace(readFile(path), std::regex(",[^,\n]*\n"), "\n");
  }

  void sweep() {
    const std::atomic<bool> stop{false};
    runSweep(plan_, stop, [](const SweepProgress&) {});
  }

  TempDir dir_;
  SweepPlan plan_;
};

TEST_P(SweepResume, ARunThatWasCutOffGoesOnAndIsTheSame) {
  const std::string path = cutOff(4);
  sweep();
  EXPECT_NE(readFile(path).find(",77.000000\n"), std::string::npos) << "it began anew";
  EXPECT_FALSE(fs::exists(fs::path(path).parent_path() / "checkpoint"));

  plan_.name = "whole";
  plan_.resume = false;
  sweep();
  const std::vector<Experiment> whole = planSweep(plan_);
  EXPECT_EQ(withoutTimes(path), withoutTimes(whole.front().runDir() + "/rounds.csv"));
  const std::string fresh = whole.front().runDir() + "/final.csv";
  if (fs::exists(fresh)) {
    EXPECT_EQ(readFile(fs::path(path).parent_path() / "final.csv"), readFile(fresh));
  }
}

TEST_P(SweepResume, WithoutItTheRunBeginsAnew) {
  const std::string path = cutOff(4);
  plan_.resume = false;
  sweep();
  EXPECT_EQ(readFile(path).find(",77.000000\n"), std::string::npos);
  // a sweep that makes checkpoints takes what one without them has finished
  plan_.resume = true;
  const std::atomic<bool> stop{false};
  int skipped = 0;
  runSweep(plan_, stop, [&](const SweepProgress& progress) { skipped += progress.skipped; });
  EXPECT_EQ(skipped, 2);
}

TEST_P(SweepResume, WithoutAGoodCheckpointTheRunBeginsAnew) {
  const std::string path = cutOff(4);
  fs::remove_all(fs::path(path).parent_path() / "checkpoint");
  sweep();
  EXPECT_EQ(readFile(path).find(",77.000000\n"), std::string::npos);
  EXPECT_EQ(runStatus(fs::path(path).parent_path()), "finished");
}

class Sweep : public ::testing::Test {
 protected:
  Sweep() {
    writeFile(plan_.config, checkpointYaml("table"));
    plan_.name = "s";
  }

  std::vector<std::string> valuesOf(const std::string& assignment) {
    plan_.assignments = {assignment, "results_dir:=" + dir_.path()};
    std::vector<std::string> names;
    for (const Experiment& run : planSweep(plan_)) names.push_back(run.settings().run_id);
    return names;
  }

  TempDir dir_;
  SweepPlan plan_{"", dir_ / "experiment.yaml", {}};
};

TEST_F(Sweep, WhatSomebodyElseWritesIsLeftAlone) {
  valuesOf("seed:=3-4");
  const std::vector<Experiment> runs = planSweep(plan_);
  const RunLog held(runs.front());
  const std::atomic<bool> stop{false};
  std::vector<std::string> in_use;
  SweepProgress last;
  runSweep(plan_, stop, [&](const SweepProgress& progress) {
    if (!progress.in_use.empty()) in_use.push_back(progress.in_use);
    last = progress;
  });
  ASSERT_EQ(in_use.size(), 1u);
  EXPECT_NE(in_use.front().find(runs.front().runDir() + " is being written by process"),
            std::string::npos);
  EXPECT_EQ(last.done, 1);
  EXPECT_EQ(runStatus(runs.front().runDir()), "running");
  EXPECT_EQ(runStatus(runs.back().runDir()), "finished");
}

TEST_F(Sweep, SaysThatItWasStoppedAlsoBeforeItsFirstRunWasDone) {
  valuesOf("seed:=3-4");
  const auto run = [&](bool stop) {
    return runSweep(plan_, std::atomic<bool>{stop}, [](const SweepProgress&) {});
  };
  const SweepResult stopped = run(true);
  EXPECT_TRUE(stopped.stopped);
  EXPECT_EQ(stopped.total, 2);
  EXPECT_FALSE(run(false).stopped);
}

TEST_F(Sweep, ARunOfOtherSettingsIsNotTouched) {
  valuesOf("seed:=3-4");
  const std::string run = planSweep(plan_).back().runDir();
  { const RunLog cut_off(planSweep(plan_).back()); }
  plan_.assignments.push_back("lambda:=3");
  const std::atomic<bool> stop{false};
  const std::string sentence = errorOf([&] { runSweep(plan_, stop, [](const SweepProgress&) {}); });
  EXPECT_EQ(sentence.rfind("the run " + run + " has other settings, with personal.lambda ", 0), 0u)
      << sentence;
  EXPECT_EQ(runStatus(run), "interrupted");
}

INSTANTIATE_TEST_SUITE_P(Learners, SweepResume, ::testing::ValuesIn(checkpointKinds()));

}  // namespace
}  // namespace pmeta
