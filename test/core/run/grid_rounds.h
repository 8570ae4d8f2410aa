#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../support.h"
#include "pmeta_core/run/round_driver.h"

namespace pmeta::test {

/// Agents, disk and people that remember what they were asked and told.
class FakeOutlet : public RoundOutlet {
 public:
  void publish(const MetaPolicy& meta) override {
    note("publish " + std::to_string(meta.round) + (meta.evaluate ? " evaluate" : "") +
         (meta.checkpoint ? " checkpoint" : ""));
  }
  void repeatMetaPolicy() override { note("repeat"); }
  void write(const RoundBook::Round& round) override {
    useDisk("write " + std::to_string(round.summary.round));
    rounds.push_back(round);
  }
  void saveCheckpoint(int round) override { useDisk("checkpoint " + std::to_string(round)); }
  void showRound(const RoundBook::Round& round) override {
    note("show " + std::to_string(round.summary.round));
  }
  void tell(const RunStanding& standing) override { told.push_back(standing); }
  void log(Level level, const std::string& sentence) override {
    logged.push_back((level == Level::kInfo      ? "info: "
                      : level == Level::kWarning ? "warning: "
                                                 : "error: ") +
                     sentence);
  }

  /// What was asked for since the last call, in order.
  std::vector<std::string> asked() { return std::exchange(asked_, {}); }

  std::string disk_error;  ///< why the disk takes nothing; "" if it does
  std::vector<RoundBook::Round> rounds;
  std::vector<RunStanding> told;
  std::vector<std::string> logged;

 private:
  void note(const std::string& what) { asked_.push_back(what); }
  void useDisk(const std::string& what) {
    if (!disk_error.empty()) {
      note("failed " + what);
      throw Error(disk_error);
    }
    note(what);
  }

  std::vector<std::string> asked_;
};

/// Three small grids, whose agents do what the test says, at the time that it says.
class GridRun {
 public:
  explicit GridRun(std::vector<std::string> overrides = {}, RoundTimes times = {})
      : experiment_(experimentOf(std::move(overrides))),
        driver(experiment_, timesOf(experiment_, times), outlet, at(0)) {}

  static RoundDriver::Time at(double seconds) {
    return RoundDriver::Time() + std::chrono::duration_cast<RoundDriver::Clock::duration>(
                                     std::chrono::duration<double>(seconds));
  }

  void begin(double now) { driver.begin(at(now)); }
  void step(double now) { driver.step(at(now)); }

  void update(int task, int round, double distance = 1) {
    auto update = std::make_shared<AuxiliaryUpdate>();
    update->run_id = "run";
    update->settings_hash = experiment_.settingsHash();
    update->task = task;
    update->round = round;
    update->model = experiment_.makeLearner(task)->auxiliary();
    for (double& value : update->model.doubles()) value = distance;
    EXPECT_EQ(driver.offer(update).verdict, MetaAggregator::Verdict::kAccepted);
  }
  bool result(int task, int round, PolicyKind policy) {
    TaskReturn result;
    result.run_id = "run";
    result.task = task;
    result.round = round;
    result.policy = policy;
    result.mean = -task;
    result.episodes = 1;
    return driver.add(result);
  }
  /// A task's round: its update, and its personal return if it has one.
  void report(int task, int round) {
    update(task, round);
    result(task, round, PolicyKind::kPersonal);
  }
  void reportAll(int round) {
    for (const int task : {0, 1, 2}) report(task, round);
  }
  void metaReturns(int round) {
    for (const int task : {0, 1, 2}) result(task, round, PolicyKind::kMeta);
  }
  /// A whole round, all at once.
  void wholeRound(int round, double now) {
    reportAll(round);
    step(now);
    metaReturns(round);
    step(now);
  }

  FakeOutlet outlet;

 private:
  static Experiment experimentOf(std::vector<std::string> overrides) {
    overrides.insert(overrides.begin(),
                     {"sizes:=[2, 3, 4]", "rounds:=4", "checkpoint.interval:=0"});
    return gridExperiment(overrides);
  }
  static RoundTimes timesOf(const Experiment& experiment, RoundTimes times) {
    times.pace = experiment.settings().pace;
    times.round_timeout = experiment.settings().aggregation.round_timeout;
    return times;
  }

  Experiment experiment_;

 public:
  RoundDriver driver;
};

}  // namespace pmeta::test
