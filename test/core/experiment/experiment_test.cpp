#include "pmeta_core/experiment/experiment.h"

#include <gtest/gtest.h>
#include <regex>

#include <filesystem>

#include "../support.h"
#include "pmeta_core/env/mountain_car.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/learn/dqn.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::TempDir;
using test::writeFile;

using Notes = std::vector<std::string>;

std::string refused(const std::vector<std::string>& overrides) {
  return errorOf([&] { gridExperiment(overrides); });
}

TEST(Experiment, PmetaTakesItsSettingsAsTheyStand) {
  const Experiment e = gridExperiment();
  EXPECT_EQ(e.settings().personal.lambda, 10);
  EXPECT_EQ(e.settings().personal.personal_init, "meta");
  EXPECT_EQ(e.settings().aggregation.beta, 1);
  EXPECT_EQ(e.algorithm().sent, Sent::kAuxiliary);
  EXPECT_TRUE(e.evaluatesMeta());
  EXPECT_FALSE(e.keepsPersonal());
  EXPECT_EQ(e.notes(), Notes{});
}

TEST(Experiment, TheSettingsHashIsThatOfWhatDefinesARun) {
  const std::string hash = gridExperiment({"run_id:=a"}).settingsHash();
  EXPECT_EQ(hash.size(), 64u);
  EXPECT_EQ(gridExperiment({"run_id:=a", "results_dir:=/elsewhere", "pace:=1"}).settingsHash(),
            hash);
  EXPECT_NE(gridExperiment({"run_id:=a", "lambda:=5"}).settingsHash(), hash);
  EXPECT_NE(gridExperiment({"run_id:=b"}).settingsHash(), hash);
}

TEST(Experiment, WhatCannotBeLearntOrHeldNamesItsSettings) {
  const auto cartPole = [](const std::vector<std::string>& overrides) {
    return Experiment::parse("{learner: dqn, environment: {name: cart_pole}}", "text", overrides);
  };
  EXPECT_EQ(errorOf([&] {
              cartPole({"n_step:=1000", "warm_up_steps:=64"});
            }),
            "dqn.warm_up_steps is 64 but dqn.n_step is 1000: nothing could be sampled; give at "
            "least as many.");
  // a terabyte
  std::string layers = "65536";
  for (int i = 1; i < 60; ++i) layers += ", 65536";
  const Experiment large = cartPole({"hidden:=[" + layers + "]"});
  EXPECT_NE(errorOf([&] { large.makeLearner(0); }).find("dqn.hidden = [65536, "),
            std::string::npos);
}

TEST(Experiment, FedProxPullsTowardsWhatTheRoundBeganWith) {
  const Experiment e = gridExperiment({"algorithm:=fedprox", "lambda:=3"});
  EXPECT_EQ(e.settings().personal.lambda, 3);
  EXPECT_EQ(e.settings().personal.eta, 0);
  EXPECT_EQ(e.notes(), Notes{"algorithm fedprox sets personal.eta to 0."});
}

TEST(Experiment, ModelAveragingIsSettings) {
  const Experiment e = gridExperiment({"algorithm:=model_averaging", "personal_init:=keep"});
  EXPECT_EQ(e.settings().personal.lambda, 0);
  EXPECT_EQ(e.algorithm().sent, Sent::kPersonal);
  EXPECT_TRUE(e.evaluatesMeta());
  EXPECT_FALSE(e.keepsPersonal());
  EXPECT_EQ(e.settings().aggregation.beta, 1);
  EXPECT_EQ(e.notes(), Notes{"algorithm model_averaging sets personal.lambda to 0, "
                             "personal.personal_init to meta."});
  EXPECT_EQ(gridExperiment({"algorithm:=model_averaging", "lambda:=0"}).notes(), Notes{});
}

TEST(Experiment, IndependentIsSettings) {
  const Experiment e = gridExperiment({"algorithm:=independent"});
  EXPECT_EQ(e.settings().personal.lambda, 0);
  EXPECT_EQ(e.settings().aggregation.beta, 0);
  EXPECT_TRUE(e.keepsPersonal());
  EXPECT_FALSE(e.evaluatesMeta());
  EXPECT_EQ(e.notes(), Notes{"algorithm independent sets personal.lambda to 0, "
                             "personal.personal_init to keep, aggregation.beta to 0."});
}

TEST(Experiment, PooledIsIndependentOnTheEnvironmentsOfAllTasks) {
  const std::string cars =
      "learner: dqn\nenvironment: {name: mountain_car, zeta: [3, 5]}\nalgorithm: pooled\n"
      "dqn: {hidden: [4], num_envs: 4}\n";
  const Experiment e = Experiment::parse(cars, "test");
  EXPECT_FALSE(e.evaluatesMeta());
  EXPECT_TRUE(e.keepsPersonal());
  EXPECT_EQ(e.settings().aggregation.beta, 0);
  const auto learner = e.makeLearner(0);
  const auto& dqn = dynamic_cast<const DqnLearner&>(learner->learner());
  ASSERT_EQ(dqn.numEnvs(), 4u);
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ(dynamic_cast<const MountainCar&>(dqn.env(k)).task().zeta, k % 2 == 0 ? 3 : 5);
  }
  EXPECT_EQ(
      errorOf([&] { Experiment::parse(cars, "test", {"num_envs:=1"}); }),
      "algorithm pooled needs at least one environment a task: set dqn.num_envs to 2 or more.");
  EXPECT_EQ(refused({"algorithm:=pooled"}),
            "algorithm pooled needs a learner that trains in several environments; q_learning "
            "does not.");
}

TEST(Experiment, UnstableStepSizesAreRefused) {
  EXPECT_EQ(refused({"alpha:=0.2"}),
            "personal.alpha = 0.2 with personal.lambda = 10 diverges: alpha must be below 2 / (1 "
            "+ lambda + gamma) = 0.168067.");
  EXPECT_EQ(refused({"eta:=0.2"}),
            "personal.eta = 0.2 with personal.lambda = 10 diverges: eta must be below 2 / lambda "
            "= 0.2.");
  EXPECT_EQ(refused({"lambda:=25"}),
            "personal.alpha = 0.08 with personal.lambda = 25 diverges: alpha must be below 2 / (1 "
            "+ lambda + gamma) = 0.0743494.");
  EXPECT_EQ(refused({"alpha:=0.168066", "eta:=0.19"}), "(no error)");
  EXPECT_EQ(refused({"alpha:=0.168068"}).substr(0, 14), "personal.alpha");
}

TEST(Experiment, TheStatedLimitOfAlphaIsItselfAllowed) {
  for (const double lambda : {0.0, 1.0, 1e3, 1e7, 1e10}) {
    const std::string l = "lambda:=" + formatNumber(lambda);
    const std::string message = refused({l, "alpha:=5", "eta:=0"});
    const auto begin = message.rfind("= ") + 2;
    const std::string limit = message.substr(begin, message.size() - begin - 1);
    EXPECT_EQ(refused({l, "alpha:=" + limit, "eta:=0"}), "(no error)") << message;
  }
}

TEST(Experiment, AlgorithmsWithoutPullAreNotCheckedForIt) {
  EXPECT_EQ(refused({"lambda:=1000", "algorithm:=model_averaging"}), "(no error)");
  EXPECT_EQ(refused({"alpha:=1.06", "algorithm:=independent"}),
            "personal.alpha = 1.06 with personal.lambda = 0 diverges: alpha must be below 2 / (1 + "
            "lambda + gamma) = 1.05263.");
}

TEST(Experiment, OvershootingStepSizesAreNoted) {
  EXPECT_EQ(gridExperiment({"alpha:=0.1", "eta:=0.125"}).notes(),
            (Notes{"warning: alpha * (1 + lambda) = 1.1 is above 1: the personalised update "
                   "overshoots.",
                   "warning: eta * lambda = 1.25 is above 1: the auxiliary update overshoots."}));
  EXPECT_EQ(gridExperiment({"alpha:=0.0625", "lambda:=15", "eta:=0.0625"}).notes(), Notes{});
}

TEST(Experiment, ValuesOutOfRangeAreRefused) {
  EXPECT_EQ(refused({"lambda:=-1"}),
            "personal.lambda is '-1' (given as lambda:=-1) but must be a number, at least 0.");
  EXPECT_EQ(refused({"beta:=1.1"}),
            "aggregation.beta is '1.1' (given as beta:=1.1) but must be a number, from 0 to 1.");
  EXPECT_EQ(refused({"gamma:=1"}),
            "q_learning.gamma is '1' (given as gamma:=1) but must be a number, from 0 to below 1.");
  EXPECT_EQ(refused({"rounds:=0"}),
            "rounds is '0' (given as rounds:=0) but must be a whole number, from 1 to 1e+06.");
  EXPECT_EQ(refused({"algorithm:=maml"}),
            "algorithm is 'maml' (given as algorithm:=maml) but must be one of "
            "fedprox, independent, model_averaging, pmeta, pooled, maml_trpo, metacure, pearl, "
            "pooled_sac, promp, rl2.");
  EXPECT_NE(refused({"algorithm:=pmtea"}).find(": did you mean 'pmeta'?"), std::string::npos);
  EXPECT_EQ(refused({"quorum:=6"}),
            "aggregation.quorum is 6 but there are 5 tasks: give at most that, or 0 for all.");
}

// what the experiment's rule makes of five contributions of one entry: 0, 1, 2, 6 and 91
double mixed(const std::vector<std::string>& overrides) {
  std::vector<Model> models;
  for (const float value : {0.0f, 1.0f, 2.0f, 6.0f, 91.0f}) {
    models.emplace_back();
    models.back().layout = ModelLayout(Precision::kFloat32, {Block{"w", {1}}});
    models.back().values = std::vector<float>{value};
  }
  std::vector<Contribution> contributions;
  for (const Model& model : models) contributions.push_back({&model, 1});
  Model meta = models.front();
  gridExperiment(overrides).rule()->mix(meta, contributions, 1);
  return std::get<std::vector<float>>(meta.values).front();
}

TEST(Experiment, RobustAggregationIsSettings) {
  EXPECT_EQ(mixed({}), 20);
  EXPECT_EQ(mixed({"trim:=0.3"}), 20) << "the mean cuts nothing";
  EXPECT_EQ(mixed({"rule:=trimmed_mean"}), 3);
  EXPECT_EQ(mixed({"rule:=trimmed_mean", "trim:=0.1"}), 20);
  EXPECT_EQ(mixed({"rule:=trimmed_mean", "beta:=0.5"}), 3) << "mixing is the aggregator's";
  EXPECT_EQ(mixed({"rule:=median"}), 2);
  EXPECT_EQ(refused({"rule:=median", "catch_up:=2"}),
            "aggregation.rule median counts all tasks the same but aggregation.catch_up is 2: set "
            "catch_up to 0, or rule to mean.");
  EXPECT_EQ(refused({"outlier_factor:=0.5"}),
            "aggregation.outlier_factor is 0.5 but must be at least 1, or 0 to leave none out.");
  EXPECT_EQ(refused({"trim:=0.5"}),
            "aggregation.trim is '0.5' (given as trim:=0.5) but must be a number, from 0 to below "
            "0.5.");
  EXPECT_EQ(refused({"rule:=mode"}),
            "aggregation.rule is 'mode' (given as rule:=mode) but must be one of mean, median, "
            "trimmed_mean.");
  EXPECT_EQ(refused({"rule:=medin"}),
            "aggregation.rule is 'medin' (given as rule:=medin) but must be one of mean, median, "
            "trimmed_mean: did you mean 'median'?");
}

TEST(Experiment, TheKeyFileIsKeptAsAnAbsolutePath) {
  EXPECT_EQ(gridExperiment().settings().key_file, "");
  const test::ScopedVariable home("HOME", "/home/someone");
  const Experiment experiment = gridExperiment({"key_file:=~/run.key"});
  EXPECT_EQ(experiment.settings().key_file, "/home/someone/run.key");
  EXPECT_NE(experiment.yaml().find("key_file: /home/someone/run.key"), std::string::npos);
  EXPECT_EQ(gridExperiment({"key_file:=run.key"}).settings().key_file,
            (std::filesystem::current_path() / "run.key").string());
}

TEST(Experiment, QuorumZeroMeansAll) {
  EXPECT_EQ(gridExperiment().quorum(), 5);
  EXPECT_EQ(gridExperiment({"quorum:=5"}).quorum(), 5);
  EXPECT_EQ(gridExperiment({"quorum:=2"}).quorum(), 2);
}

TEST(Experiment, UnknownEnvironmentsAreRefusedWhereverTheyAreNamed) {
  const std::string sentence =
      "unknown environment 'gridwrld': did you mean 'gridworld'? Known "
      "are " +
      join(envFamilies().names()) + ".";
  EXPECT_EQ(errorOf([] { Experiment::parse("environment: {name: gridwrld}", "a.yaml"); }),
            sentence);
  for (const std::string given : {"environment.name:=gridwrld", "environment.name:=\"gridwrld\"",
                                  "environment.name:= gridwrld", "name:=gridwrld"}) {
    EXPECT_EQ(refused({given}), sentence) << given;
  }
}

TEST(Experiment, OverridingAnUnknownEnvironmentDoesNotHideIt) {
  EXPECT_EQ(refused({"name:=gridwrld", "environment.name:=\"gridworld\""}),
            "environment.name is 'gridwrld' (given as name:=gridwrld) but must be one of " +
                join(envFamilies().names()) + ": did you mean 'gridworld'?");
  EXPECT_EQ(gridExperiment({"environment.name:=gridworld"}).settings().environment, "gridworld");
  EXPECT_EQ(errorOf([] {
              Experiment::parse("environment: {name: gridwrld}", "a.yaml",
                                {"environment.name:=gridworld"});
            }),
            "environment.name is 'gridwrld' (a.yaml line 1) but must be one of " +
                join(envFamilies().names()) + ": did you mean 'gridworld'?");
}

TEST(Experiment, OddEnvironmentSectionsAreRefused) {
  EXPECT_EQ(errorOf([] { Experiment::parse("environment: gridworld", "a.yaml"); }),
            "'environment' is a group of settings (a.yaml line 1): write its keys below it, "
            "indented.");
  EXPECT_NE(errorOf([] { Experiment::parse("environment: {name: [gridworld]}", "a.yaml"); }),
            "(no error)");
  EXPECT_NE(refused({"environment.name:=[gridworld]"}), "(no error)");
  EXPECT_NE(refused({"environment.name:=[grid"}), "(no error)");
}

TEST(Experiment, UnknownKeysOfTheEnvironmentAreRefused) {
  EXPECT_EQ(errorOf([] { Experiment::parse("environment: {size: [4]}", "a.yaml"); }),
            "unknown setting 'environment.size' (a.yaml line 1): did you mean "
            "'environment.sizes'?");
}

TEST(Experiment, NamesMustBePlain) {
  for (const std::string key : {"run_id", "experiment"}) {
    for (const std::string bad : {"a/b", "../x", "a b", "..", ".", "a\\b", "a'b"}) {
      EXPECT_EQ(refused({key + ":=" + bad}),
                key + " is '" + bad +
                    "' but must be a plain name in UTF-8, without blanks, quotes or slashes.");
    }
  }
  EXPECT_EQ(
      refused({"experiment:="}),
      "experiment is '' but must be a plain name in UTF-8, without blanks, quotes or slashes.");
}

TEST(Experiment, NamesThatATerminalOrAManifestCannotTakeAreRefused) {
  EXPECT_EQ(refused({"run_id:=\"a\\x1b[31mRED\""}),
            "run_id is 'a?[31mRED' but must be a plain name in UTF-8, without blanks, quotes or "
            "slashes.");
  EXPECT_NE(refused({"run_id:=a\xff"
                     "b"})
                .find("UTF-8"),
            std::string::npos);
  EXPECT_NE(refused({"results_dir:=/tmp/a\xff"
                     "b"})
                .find("UTF-8"),
            std::string::npos);
  EXPECT_EQ(refused({"run_id:=caf\xc3\xa9"}), "(no error)");
  EXPECT_EQ(refused({"run_id:=" + std::string(200, 'x')}), "(no error)");
  EXPECT_NE(refused({"run_id:=" + std::string(201, 'x')}).find("at most 200"), std::string::npos);
}

TEST(Experiment, RunIdIsMadeOfTimeAlgorithmAndSeedIfNotGiven) {
  const Experiment e = gridExperiment({"run_id:=", "seed:=4"});
  const std::string id = e.settings().run_id;
  ASSERT_EQ(id.size(), std::string("20261122T061203_pmeta_seed4").size()) << id;
  EXPECT_EQ(id.substr(8, 1), "T");
  EXPECT_EQ(id.substr(15), "_pmeta_seed4");
}

TEST(Experiment, EffectiveYamlParsesBackToItself) {
  for (const std::string algorithm : {"pmeta", "model_averaging", "independent"}) {
    const Experiment e =
        gridExperiment({"algorithm:=" + algorithm, "run_id:=", "alpha:=0.03", "sizes:=[3, 9]",
                        "slip:=[0.1, 0]", "seed:=12345678901", "results_dir:=\"/tmp/a, b: #c\""});
    const Experiment back = Experiment::parse(e.yaml(), "back");
    EXPECT_EQ(back.yaml(), e.yaml());
    EXPECT_EQ(back.runDir(), e.runDir());
    EXPECT_EQ(back.notes(), Notes{}) << "nothing is left to be changed";
    EXPECT_EQ(back.settings().seed, 12345678901);
  }
}

TEST(Experiment, LoadReadsAFile) {
  const TempDir dir;
  writeFile(dir / "e.yaml", "seed: 3\nenvironment: {sizes: [4]}\n");
  const Experiment e = Experiment::load(dir / "e.yaml", {"rounds:=2"});
  EXPECT_EQ(e.settings().seed, 3);
  EXPECT_EQ(e.settings().rounds, 2);
  EXPECT_EQ(e.numTasks(), 1);
  EXPECT_EQ(
      errorOf([&] { Experiment::load(dir / "none.yaml"); }),
      "the settings file " + (dir / "none.yaml") + " cannot be read (No such file or directory).");
}

TEST(Experiment, TheRepositorysConfigsAreValid) {
  const std::filesystem::path config =
      std::filesystem::path(PMETA_TEST_DATA).parent_path() / "../config";
  for (const std::string name :
       {"gridworld", "gridworld_conflict", "cart_pole", "mountain_car", "half_cheetah_dir",
        "half_cheetah_vel", "ant_fwd_back", "walker_2d_params", "sparse_point_robot"}) {
    const Experiment e = Experiment::load((config / (name + ".yaml")).string());
    EXPECT_EQ(e.settings().experiment, name);
    EXPECT_EQ(e.notes(), Notes{}) << name;
  }
}

TEST(Experiment, LearnersOfAllTasksShareOneLayout) {
  const Experiment e = gridExperiment();
  for (int task = 0; task < 5; ++task) {
    EXPECT_EQ(e.makeLearner(task)->layout().text(), "float64\nq_table 64 4\n");
  }
}

TEST(Experiment, DescribesEverySettingWithItsValueAndDefault) {
  const std::string text = gridExperiment({"lambda:=5", "landmark:=centre"}).describe();
  for (const std::string part :
       {"personal.lambda +5  \\(default: 10\\)\n", "strength of the pull",
        "environment.landmark +centre  \\(default: corner\\)\n", "aggregation.beta"}) {
    EXPECT_TRUE(std::regex_search(text, std::regex(part))) << part << "\n" << text;
  }
}

TEST(Experiment, AnotherLearnerIsNoDefault) {
  const Experiment e = Experiment::parse(
      "experiment: cart\nlearner: dqn\nenvironment: {name: cart_pole}\n", "the test");
  const std::string text = e.describe();
  EXPECT_NE(text.find("dqn  (default: q_learning)\n"), std::string::npos) << text;
  EXPECT_NE(text.find("cart_pole  (default: gridworld)\n"), std::string::npos) << text;
  EXPECT_NE(text.find("  dqn.batch_size "), std::string::npos) << text;
  EXPECT_EQ(text.find("q_learning.updates"), std::string::npos) << text;
}

}  // namespace
}  // namespace pmeta
