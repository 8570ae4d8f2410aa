// A run whose tasks are all learnt by one meta-learner.
#include "pmeta_core/run/meta_trainer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <stdexcept>

#include "../support.h"
#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/run/local_runner.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::readFile;
using test::TempDir;
using testing::ElementsAre;
using testing::HasSubstr;

// three training tasks and one test task; an iteration makes 80 transitions of each
constexpr char kPoints[] = R"(
experiment: points
run_id: run
algorithm: promp
learner: sac
rounds: 4
updates_per_round: 100
steps_per_round: 300
sac: {hidden: [8, 8]}
personal: {lambda: 15}
aggregation: {beta: 0.5, round_timeout: 7}
checkpoint: {interval: 1}
promp: {hidden: [8], episodes: 2, exploration_episodes: [2], evaluation_episodes: 2, action_scale: 1}
environment: {name: sparse_point_robot, train_tasks: 3, test_tasks: 1}
)";

Experiment points(const std::vector<std::string>& overrides = {}, const std::string& more = "") {
  return Experiment::parse(kPoints + more, "points.yaml", overrides);
}

std::string rowsOf(const Experiment& experiment) {
  return std::regex_replace(readFile(experiment.runDir() + "/rounds.csv"), std::regex(",[^,\n]*\n"),
                            "\n");
}

std::string lossesOf(const Experiment& experiment) {
  return readFile(experiment.runDir() + "/losses.csv");
}

std::uint32_t policyOf(const Experiment& experiment) {
  return loadPolicy(experiment.runDir() + "/policies/meta.safetensors").model.checksum();
}

TEST(MetaTrainer, EvaluatesEachTaskBeforeAndAfterExplorationAndCountsItsSteps) {
  const LocalResult result = runLocally(points({"results_dir:=/tmp/pmeta_unused"}));
  ASSERT_EQ(result.rounds.size(), 4u);
  std::vector<std::int64_t> steps;
  for (const RoundBook::Round& round : result.rounds) {
    ASSERT_EQ(round.rows.size(), 8u);  // four tasks, before and after
    EXPECT_THAT(round.summary.participants, ElementsAre(0));
    EXPECT_TRUE(std::isnan(round.summary.personal_return));
    EXPECT_FALSE(std::isnan(round.summary.test_return));
    for (const RoundRow& row : round.rows) {
      EXPECT_EQ(row.result.policy, PolicyKind::kMeta);
      EXPECT_EQ(row.result.context_episodes, (&row - &round.rows[0]) % 2 == 1 ? 2 : 0);
      EXPECT_EQ(row.env_steps, row.result.task < 3 ? round.rows[0].env_steps : 0);
    }
    steps.push_back(round.rows[0].env_steps);
  }
  // whole iterations of 80 steps a task; rounds end at 100, 200, 300 and 400 of them
  EXPECT_THAT(steps, ElementsAre(160, 240, 320, 400));
}

TEST(MetaTrainer, ARoundThatIsWorkedOffAlreadyTrainsNothing) {
  const LocalResult result = runLocally(points({"steps_per_round:=40", "rounds:=7"}));
  std::vector<std::int64_t> steps;
  for (const auto& round : result.rounds) steps.push_back(round.rows[0].env_steps);
  EXPECT_THAT(steps, ElementsAre(80, 80, 80, 80, 80, 80, 160));
}

TEST(MetaTrainer, ByDefaultARoundHasTheStepsOfTheAgents) {
  EXPECT_EQ(points({"steps_per_round:=0"}).stepsPerRound(), 300);
}

TEST(MetaTrainer, EvaluatesAsScheduled) {
  const LocalResult result = runLocally(points({"evaluation_interval:=3"}));
  std::vector<std::size_t> rows;
  for (const auto& round : result.rounds) rows.push_back(round.rows.size());
  EXPECT_THAT(rows, ElementsAre(0, 0, 8, 8));
  EXPECT_EQ(result.rounds[2].rows[0].result.env_steps, 320);
  EXPECT_EQ(result.rounds[3].rows[0].result.env_steps, 80);
}

TEST(MetaTrainer, ResumedRunIsTheUninterruptedOne) {
  const TempDir whole, parts;
  const Experiment uninterrupted = points({"results_dir:=" + whole.path()});
  {
    RunLog log(uninterrupted);
    runLocally(uninterrupted, &log);
    log.finish("finished");
  }
  const Experiment begun = points({"results_dir:=" + parts.path()});
  {
    RunLog log(begun);
    EXPECT_THROW(runLocally(begun, &log,
                            [](const RoundBook::Round& round) -> bool {
                              if (round.summary.round == 2) throw std::runtime_error("crash");
                              return true;
                            }),
                 std::runtime_error);
  }
  const Experiment resumed = Experiment::resume(begun.runDir());
  const ResumePoint point = findResumePoint(resumed);
  EXPECT_GT(point.round, 0);
  RunLog log = RunLog::reopen(resumed, point.rounds_done);
  runLocally(resumed, &log, {}, point.round);
  log.finish("finished");
  EXPECT_EQ(rowsOf(resumed), rowsOf(uninterrupted));
  EXPECT_EQ(lossesOf(resumed), lossesOf(uninterrupted));
  EXPECT_THAT(lossesOf(resumed), HasSubstr("4,0,return_after_step,"));
  EXPECT_EQ(policyOf(resumed), policyOf(uninterrupted));
}

TEST(MetaTrainer, TheSameRoundAgainGivesTheSameUpdate) {
  const Experiment experiment = points();
  MetaTrainer trainer(experiment);
  MetaPolicy meta;
  meta.model = experiment.initialModel();
  const auto first = trainer.trainRound(meta);
  const auto again = trainer.trainRound(meta);
  EXPECT_EQ(first->update.model, again->update.model);
  EXPECT_EQ(again->update.round, 1);
  EXPECT_FALSE(first->update.model == meta.model);
  EXPECT_FALSE(first->personal);
}

TEST(MetaTrainer, WithoutAStateItGoesOnFromTheMetaPolicy) {
  const Experiment experiment = points();
  MetaTrainer trainer(experiment);
  MetaPolicy meta;
  meta.model = experiment.initialModel();
  meta.round = 2;
  EXPECT_EQ(trainer.evaluateMeta(meta)[0].env_steps, 0);
  EXPECT_EQ(trainer.trainRound(meta)->env_steps, 480);  // those of one round
  meta.round = 3;
  EXPECT_EQ(trainer.evaluateMeta(meta)[0].env_steps, 160);
}

TEST(MetaTrainer, StopsInTheMiddleOfARound) {
  const Experiment experiment = points();
  MetaTrainer trainer(experiment);
  MetaPolicy meta;
  meta.model = experiment.initialModel();
  std::vector<std::int64_t> done;
  EXPECT_FALSE(trainer.trainRound(meta, [&](std::int64_t steps) {
    done.push_back(steps);
    return false;
  }));
  EXPECT_THAT(done, ElementsAre(240));
}

TEST(MetaTrainer, AnEpisodeIsTheFirstBehindTheReturn) {
  const Experiment experiment = points({"promp.evaluation_episodes:=1"});
  MetaTrainer trainer(experiment);
  MetaPolicy meta;
  meta.model = experiment.initialModel();
  meta.round = 1;
  EXPECT_THAT(errorOf([&] { trainer.recordMeta(meta, 0); }), HasSubstr("has not been evaluated"));
  MetaPolicy initial;
  initial.model = meta.model;
  trainer.trainRound(initial);
  const std::vector<TaskReturn> returns = trainer.evaluateMeta(meta);
  const Episode episode = trainer.recordMeta(meta, 3);
  double sum = 0;
  for (const double reward : episode.rewards) sum += reward;
  EXPECT_DOUBLE_EQ(sum, returns.back().mean);
}

TEST(MetaTrainer, ItsPolicyActs) {
  const TempDir dir;
  const Experiment experiment = points({"results_dir:=" + dir.path(), "rounds:=1"});
  RunLog log(experiment);
  runLocally(experiment, &log);
  log.finish("finished");
  LoadedPolicy policy(experiment.runDir() + "/policies/meta.safetensors");
  const double observation[] = {0, 0};
  double action[] = {9, 9};
  ASSERT_TRUE(policy.act(observation, action));
  EXPECT_LE(std::abs(action[0]), 1);
  EXPECT_THAT(readFile(experiment.runDir() + "/manifest.json"), HasSubstr("\"ProMP\""));
}

TEST(MetaLearnerSettings, WhatAFileSaysOfAgentsIsNotReadButOverridesAreRefused) {
  EXPECT_EQ(points().yaml().find("lambda: 15"), std::string::npos);
  EXPECT_EQ(points().settings().aggregation.round_timeout, 7);
  EXPECT_EQ(points().settings().aggregation.beta, 1);
  EXPECT_THAT(errorOf([] { points({"personal.lambda:=3"}); }), HasSubstr("personal.lambda"));
}

TEST(MetaLearnerSettings, AFileMaySayWhatIsDifferentForAnAlgorithm) {
  const std::string more = R"(
presets:
  quick: {rounds: 2, promp: {clip: 0.5}}
algorithms:
  promp:
    seed: 5
    promp: {clip: 0.1, learning_rate: 0.5}
    presets:
      quick: {promp: {learning_rate: 0.25}}
      only_here: {rounds: 3}
  maml_trpo: {seed: 6}
)";
  const auto value = [](const Experiment& e, const std::string& key) {
    return e.definingSettings().at(key);
  };
  const Experiment plain = points({}, more);
  EXPECT_EQ(plain.settings().seed, 5);
  EXPECT_EQ(value(plain, "promp.clip"), "0.1");
  // a preset is read over what the file says of the algorithm, the algorithm's own preset last
  const Experiment quick = points({"preset:=quick"}, more);
  EXPECT_EQ(quick.settings().rounds, 2);
  // and takes nothing of them away
  EXPECT_EQ(quick.settings().seed, 5);
  EXPECT_EQ(quick.settings().experiment, plain.settings().experiment);
  EXPECT_EQ(value(quick, "environment.name"), value(plain, "environment.name"));
  EXPECT_EQ(value(quick, "promp.clip"), "0.5");
  EXPECT_EQ(value(quick, "promp.learning_rate"), "0.25");
  EXPECT_EQ(points({"preset:=only_here"}, more).settings().rounds, 3);
  EXPECT_EQ(errorOf([&] { points({"preset:=nothing"}, more); }),
            "unknown preset of points.yaml 'nothing'. Known are quick, only_here.");
  EXPECT_THAT(errorOf([&] { points({}, "algorithms: {prompt: {seed: 1}}\n"); }),
              HasSubstr("unknown algorithm 'prompt': did you mean 'promp'?"));
  // what is effective reads as itself
  EXPECT_EQ(Experiment::parse(quick.yaml(), "again").yaml(), quick.yaml());
}

TEST(MetaLearnerSettings, RefuseEnvironmentsTheyCannotHave) {
  EXPECT_THAT(errorOf([] {
                Experiment::parse("{algorithm: promp, environment: {name: cart_pole}}", "a.yaml")
                    .makeMetaLearner();
              }),
              HasSubstr("has discrete actions: a Gaussian policy needs continuous ones."));
}

}  // namespace
}  // namespace pmeta
