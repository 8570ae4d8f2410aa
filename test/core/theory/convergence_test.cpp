#include "pmeta_core/theory/convergence.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

// small enough for a second, large enough to show the theory
ConvergenceSettings smallSettings() {
  ConvergenceSettings settings;
  settings.run_id = "test";
  settings.sizes = {3, 4, 5};
  settings.rounds = 80;
  settings.diversities = {"centre", "random", "random_slip"};
  settings.contraction.lambdas = {0, 10};
  settings.contraction.pairs = 100;
  settings.fixed_point.lambdas = {0, 10};
  settings.fixed_point.sweeps = 2000;
  settings.meta.lambdas = {1, 5, 10, 20, 50};
  settings.meta.draws = 3;
  return settings;
}

// measured once: the tests look at different parts of it
const ConvergenceReport& smallReport() {
  static const ConvergenceReport kReport = measureConvergence(smallSettings());
  return kReport;
}

std::vector<FixedPointRow> rowsOf(const std::string& update, double lambda) {
  std::vector<FixedPointRow> rows;
  for (const FixedPointRow& row : smallReport().fixed_point) {
    if (row.update == update && row.lambda == lambda) rows.push_back(row);
  }
  return rows;
}

std::string errorOf(const std::string& yaml, const std::vector<std::string>& overrides = {}) {
  try {
    parseConvergence(yaml, "test.yaml", overrides);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Convergence, ContractionAttainsItsBoundAndNeverExceedsIt) {
  ASSERT_EQ(smallReport().contraction.size(), 2u);
  for (const ContractionRow& row : smallReport().contraction) {
    EXPECT_DOUBLE_EQ(row.bound, 0.9 / (1 + row.lambda));
    EXPECT_LE(row.worst_pair, row.bound + 1e-12);
    EXPECT_NEAR(row.worst_shift, row.bound, 1e-12);
  }
}

TEST(Convergence, ExpectedUpdateReachesTheFixedPointOnlyWithTheMinusSign) {
  for (const double lambda : {0.0, 10.0}) {
    EXPECT_GT(rowsOf("exact", lambda).front().distance, 1e-2);
    EXPECT_LE(rowsOf("exact", lambda).back().distance, 1e-12);
  }
  EXPECT_GT(rowsOf("plus_sign", 10).back().distance, 10 * rowsOf("plus_sign", 10).front().distance);
}

TEST(Convergence, SampledUpdateReachesTheFixedPointAndConstantStepsStall) {
  const std::vector<FixedPointRow> shrinking = rowsOf("robbins_monro", 10);
  const std::vector<FixedPointRow> constant = rowsOf("constant", 10);
  EXPECT_LT(shrinking.back().distance, 0.1);
  EXPECT_GT(constant.back().distance, 4 * shrinking.back().distance);
}

TEST(Convergence, StepLimitIsWhereTheoryPutsIt) {
  EXPECT_NEAR(smallReport().step_limit[1].predicted, 22 / 11.9, 1e-12);
  EXPECT_NEAR(smallReport().step_limit[1].measured, 22 / 11.9, 0.01);
  EXPECT_GE(smallReport().step_limit[0].measured, 2 / 1.9 - 0.01);
}

TEST(Convergence, GradientVanishesWhereAuxiliariesDoNotDrift) {
  ConvergenceSettings settings = smallSettings();
  settings.diversities = {"random"};
  settings.contraction.lambdas = {10};
  settings.contraction.pairs = 1;
  settings.fixed_point.lambdas = {10};
  settings.fixed_point.sweeps = 100;
  settings.meta.lambdas = {10};
  // one exact step a round is plain descent along grad L: it may only end where that is 0
  settings.updates_per_round = 1;
  settings.rounds = 400;
  EXPECT_LT(measureConvergence(settings).distance.front().gradient_left, 1e-8);
  // three steps drift apart, and leave a floor
  settings.updates_per_round = 3;
  const double left = measureConvergence(settings).distance.front().gradient_left;
  EXPECT_GT(left, 1e-6);
  EXPECT_LT(left, 1e-2);
}

TEST(Convergence, RunningMeanFallsAboutAsOneOverC) {
  for (const DistanceRow& row : smallReport().distance) {
    if (row.lambda > 10) continue;
    EXPECT_LT(row.slope, -0.8) << row.diversity << " " << row.lambda;
    EXPECT_GT(row.slope, -1.05) << row.diversity << " " << row.lambda;
  }
}

TEST(Convergence, StepConditionOfTheTheorem) {
  for (const DistanceRow& row : smallReport().distance) {
    if (row.lambda == 1) {
      // lambda^2 <= 8: the theorem says nothing
      EXPECT_TRUE(std::isnan(row.allowed_eta));
      EXPECT_TRUE(std::isnan(row.entry_bound));
    }
    if (row.lambda != 10) continue;
    // 0.25 / (3 * 10 * (1.5 + 12/92 + 2400/92))
    EXPECT_NEAR(row.allowed_eta, 3.0066e-4, 1e-8);
    EXPECT_GT(row.allowed_factor, 0.98);
    EXPECT_LT(row.allowed_factor, 1);
  }
}

TEST(Convergence, DistanceFallsAsOneOverLambdaSquared) {
  std::vector<double> scaled;
  for (const DistanceRow& row : smallReport().distance) {
    EXPECT_NEAR(row.gradient_bound / row.distance2, 2, 1e-9);
    if (row.lambda < 5) continue;
    EXPECT_LE(row.entry_ratio, 1);
    if (row.diversity == "random") scaled.push_back(row.lambda * row.lambda * row.mean_distance2);
  }
  ASSERT_EQ(scaled.size(), 4u);
  for (const double one : scaled) EXPECT_NEAR(one / scaled[1], 1, 0.15);
}

TEST(Convergence, MeanDistanceIsOverTheDrawsOfTheFollowingSeeds) {
  ConvergenceSettings settings = smallSettings();
  settings.diversities = {"centre", "random"};
  settings.contraction.pairs = 1;
  settings.fixed_point.sweeps = 100;
  settings.meta.lambdas = {10};
  double sum = 0;
  for (settings.seed = 0; settings.seed < 3; ++settings.seed) {
    sum += measureConvergence(settings).distance.back().distance2;
  }
  settings.seed = 0;
  const std::vector<DistanceRow> rows = measureConvergence(settings).distance;
  EXPECT_NEAR(rows.back().mean_distance2, sum / 3, 1e-12 * sum);
  EXPECT_NE(rows.back().mean_distance2, rows.back().distance2);
  // nothing is drawn where the landmark is in the centre
  EXPECT_EQ(rows.front().mean_distance2, rows.front().distance2);
}

TEST(Convergence, SigmaOfTwoGridsByHand) {
  // entries that both own: rewards differ by at most 2, and moving right from (0,1) leads one into
  // the wall; the larger grid's worst reward is -4
  ConvergenceSettings settings = smallSettings();
  settings.sizes = {2, 3};
  settings.diversities = {"corner"};
  settings.contraction.pairs = 1;
  settings.fixed_point.sweeps = 100;
  settings.meta.lambdas = {10};
  const DiversityRow row = measureConvergence(settings).diversities.front();
  EXPECT_EQ(row.sigma1, (std::vector<double>{1, 1}));
  EXPECT_EQ(row.sigma2, (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(row.r_max, 4);
  EXPECT_NEAR(row.sigma, 1 + 0.5 * 9 * 4, 1e-12);

  settings.sizes = {4, 4};
  EXPECT_EQ(measureConvergence(settings).diversities.front().sigma, 0);
}

TEST(Convergence, SameSeedSameBytes) {
  const std::vector<CsvFile> first = convergenceCsv(smallReport());
  const std::vector<CsvFile> again = convergenceCsv(measureConvergence(smallSettings()));
  ASSERT_EQ(first.size(), 6u);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].name, again[i].name);
    EXPECT_EQ(first[i].text, again[i].text) << first[i].name;
  }
  ConvergenceSettings other = smallSettings();
  other.seed = 1;
  EXPECT_NE(first[3].text, convergenceCsv(measureConvergence(other))[3].text);
}

TEST(Convergence, TableFitsAConsole) {
  std::istringstream table(convergenceTable(smallReport()));
  int lines = 0;
  for (std::string line; std::getline(table, line); ++lines) EXPECT_LE(line.size(), 110u) << line;
  EXPECT_GT(lines, 30);
}

TEST(Convergence, WritesAWholeRunOnce) {
  const std::string dir =
      testing::TempDir() + "pmeta_convergence_" + std::to_string(::getpid()) + "/run";
  writeConvergence(smallReport(), dir);
  for (const char* name : {"contraction.csv", "fixed_point.csv", "step_limit.csv", "gradient.csv",
                           "distance.csv", "statements.csv", "config.yaml", "manifest.json"}) {
    EXPECT_TRUE(std::filesystem::exists(dir + "/" + name)) << name;
  }
  std::ifstream config(dir + "/config.yaml");
  std::ostringstream text;
  text << config.rdbuf();
  EXPECT_EQ(text.str(), convergenceYaml(smallReport().settings));
  try {
    writeConvergence(smallReport(), dir);
    FAIL() << "wrote over a run";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "the run folder " + dir + " already holds a run: choose another run_id.");
  }
  std::filesystem::remove_all(dir + "/..");
}

TEST(Convergence, ReportsProgress) {
  ConvergenceSettings settings = smallSettings();
  settings.fixed_point.sweeps = 100;
  settings.rounds = 20;
  double last = -1;
  measureConvergence(settings, [&](const std::string& what, double done) {
    EXPECT_FALSE(what.empty());
    EXPECT_GE(done, last);
    last = done;
  });
  EXPECT_EQ(last, 1);
}

TEST(ConvergenceSettings, ReadBackAsWritten) {
  ConvergenceSettings settings = smallSettings();
  settings.results_dir = "/tmp/results";
  const std::string yaml = convergenceYaml(settings);
  EXPECT_EQ(convergenceYaml(parseConvergence(yaml, "test.yaml")), yaml);
  EXPECT_EQ(convergenceDir(settings), "/tmp/results/convergence/test");
}

TEST(ConvergenceSettings, RunIdIsMadeOfTimeAndSeed) {
  const ConvergenceSettings settings = parseConvergence("seed: 7", "test.yaml");
  EXPECT_EQ(settings.run_id.substr(settings.run_id.size() - 6), "_seed7");
  EXPECT_EQ(settings.results_dir.front(), '/');
}

TEST(ConvergenceSettings, MistakesAreNamed) {
  EXPECT_EQ(errorOf("gama: 0.9"),
            "unknown setting 'gama' (test.yaml line 1): did you mean 'gamma'?");
  EXPECT_EQ(errorOf("gamma: 1"),
            "gamma is '1' (test.yaml line 1) but must be a number, from 0 to below 1.");
  EXPECT_EQ(errorOf("meta:\n  lambdas: [0, 5]"),
            "meta.lambdas is '[0, 5]' (test.yaml line 2) but must be a list of numbers, above 0.");
  EXPECT_EQ(errorOf("diversities: [corner, middle]"),
            "diversities holds 'middle' (test.yaml line 1) but must be one of corner, centre, "
            "random, random_slip.");
  EXPECT_EQ(errorOf("diversities: [corner, corner]"),
            "diversities names 'corner' twice: keep one of them.");
  EXPECT_EQ(errorOf("environment:\n  slip: [0, 0.1]"),
            "environment.slip has 2 values for 5 tasks: give one, or one for each task.");
  EXPECT_EQ(
      errorOf("run_id: a/b"),
      "run_id is 'a/b' but must be a plain name in UTF-8, without blanks, quotes or slashes.");
  EXPECT_EQ(errorOf("seed: 0", {"step_exponent:=0.5"}),
            "fixed_point.step_exponent is '0.5' (given as step_exponent:=0.5) but must be a "
            "number, above 0.5 to 1.");
  EXPECT_NE(errorOf("seed: 0", {"lambdas:=3"}).find("setting 'lambdas' is ambiguous"),
            std::string::npos);
}

}  // namespace
}  // namespace pmeta
