#include "pmeta_core/run/local_runner.h"

#include <gtest/gtest.h>

#include <cmath>

#include "../support.h"

namespace pmeta {
namespace {

using test::gridExperiment;
using test::readFile;
using test::TempDir;

// everything of a run but the wall times
std::string recordOf(const LocalResult& result) {
  std::string text;
  for (const auto& round : result.rounds) {
    for (RoundRow row : round.rows) {
      row.result.seconds = 0;
      text += RunLog::csvLine(row) + "\n";
    }
  }
  return text;
}

LocalResult run(const std::vector<std::string>& overrides = {}) {
  return runLocally(gridExperiment(overrides));
}

TEST(LocalRunner, OneSeedGivesOneResultBitForBit) {
  for (const std::string init : {"meta", "keep"}) {
    const LocalResult a = run({"personal_init:=" + init, "slip:=0.1"});
    const LocalResult b = run({"personal_init:=" + init, "slip:=0.1"});
    EXPECT_EQ(a.rounds.size(), 10u);
    EXPECT_EQ(recordOf(a), recordOf(b));
    EXPECT_TRUE(a.meta == b.meta);
  }
}

TEST(LocalRunner, AnotherSeedGivesAnotherResult) {
  const LocalResult a = run({"seed:=0"}), b = run({"seed:=1"});
  EXPECT_NE(recordOf(a), recordOf(b));
  EXPECT_FALSE(a.meta == b.meta);
}

TEST(LocalRunner, ResultsAreThePinnedOnes) {
  // change these only with a reason: they prove that a refactoring changed no bit
  EXPECT_EQ(hexHash(run().meta.checksum()), "0x00000000fd518f17");
  EXPECT_EQ(hexHash(run({"personal_init:=keep", "landmark:=random", "slip:=0.1", "seed:=42",
                         "beta:=0.5", "q_learning.updates:=2"})
                        .meta.checksum()),
            "0x00000000ca3b0371");
  EXPECT_EQ(hexHash(run({"algorithm:=model_averaging"}).meta.checksum()), "0x0000000039216909");
}

TEST(LocalRunner, RoundsGoOnWithoutWhatIsLeftOut) {
  const LocalResult all = run(), some = run({"outlier_factor:=1"}),
                    none = run({"max_update_norm:=1e-9"});
  ASSERT_EQ(some.rounds.size(), 10u);
  const RoundSummary& first = some.rounds.front().summary;
  EXPECT_FALSE(first.excluded.empty());
  EXPECT_FALSE(first.participants.empty());
  EXPECT_EQ(first.excluded.size() + first.participants.size(), 5u);
  EXPECT_EQ(first.missing, std::vector<int>{});
  EXPECT_EQ(some.rounds.front().rows.size(), all.rounds.front().rows.size());
  EXPECT_FALSE(some.meta == all.meta);
  EXPECT_EQ(none.rounds.back().summary.participants, std::vector<int>{});
  EXPECT_EQ(none.meta.doubles(), std::vector<double>(none.meta.size(), 0.0));
}

TEST(LocalRunner, PmetaReachesTheOptimumWhereTasksAgree) {
  // the mean of -d(d-1)/2 over the five corner grids
  const double optimum = -14.442976190476191;
  for (const std::string seed : {"0", "1", "2"}) {
    const LocalResult result = run({"seed:=" + seed});
    const RoundSummary& last = result.rounds.back().summary;
    EXPECT_NEAR(last.personal_return, optimum, 0.3) << "seed " << seed;
    EXPECT_NEAR(last.meta_return, optimum, 0.3) << "seed " << seed;
    EXPECT_LE(last.personal_return, optimum + 1e-9) << "nothing beats the optimum";
    EXPECT_LE(last.meta_return, optimum + 1e-9);
    EXPECT_LT(result.rounds.front().summary.personal_return, optimum - 20)
        << "the first round cannot know it all";
  }
}

TEST(LocalRunner, PersonalPoliciesBeatTheMetaPolicyWhereTasksConflict) {
  const LocalResult result = run({"landmark:=centre", "samples_per_entry:=1"});
  const RoundSummary& last = result.rounds.back().summary;
  EXPECT_GT(last.personal_return, last.meta_return + 3);
}

TEST(LocalRunner, IndependentTrainingNeverChangesTheMetaPolicy) {
  const LocalResult result = run({"algorithm:=independent", "initial_value:=-1.5"});
  EXPECT_EQ(result.meta.doubles(), std::vector<double>(256, -1.5));
  for (const auto& round : result.rounds) {
    EXPECT_EQ(round.rows.size(), 5u);
    EXPECT_TRUE(std::isnan(round.summary.meta_return));
  }
  EXPECT_GT(result.rounds.back().summary.personal_return,
            result.rounds.front().summary.personal_return);
}

TEST(LocalRunner, BetaZeroKeepsTheMetaPolicyOfPmetaToo) {
  const LocalResult result = run({"beta:=0", "initial_value:=-1.5"});
  EXPECT_EQ(result.meta.doubles(), std::vector<double>(256, -1.5));
}

TEST(LocalRunner, CountsStepsAndUpdatesOverRounds) {
  const LocalResult result = run({"sizes:=[4, 5]", "rounds:=3"});
  for (const auto& round : result.rounds) {
    for (const RoundRow& row : round.rows) {
      const int entries = row.result.task == 0 ? 15 * 4 : 24 * 4;
      EXPECT_EQ(row.env_steps, round.summary.round * 3 * 2 * entries);
      EXPECT_EQ(row.updates, round.summary.round * 3);
    }
  }
}

TEST(LocalRunner, EvaluatesAtItsIntervalAndInTheLastRound) {
  const LocalResult all = run({"rounds:=7"});
  const LocalResult some = run({"rounds:=7", "evaluation_interval:=3"});
  EXPECT_TRUE(all.meta == some.meta) << "evaluating changes nothing";
  ASSERT_EQ(some.rounds.size(), 7u);
  for (std::size_t c = 0; c < 7; ++c) {
    const auto& rows = some.rounds[c].rows;
    if (c != 2 && c != 5 && c != 6) {
      EXPECT_TRUE(rows.empty());
      EXPECT_TRUE(std::isnan(some.rounds[c].summary.personal_return));
      continue;
    }
    // the same returns, and the counters of all rounds
    ASSERT_EQ(rows.size(), all.rounds[c].rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      EXPECT_EQ(rows[k].result.mean, all.rounds[c].rows[k].result.mean);
      EXPECT_EQ(rows[k].env_steps, all.rounds[c].rows[k].env_steps);
      EXPECT_EQ(rows[k].updates, all.rounds[c].rows[k].updates);
    }
  }
}

TEST(LocalRunner, MetaRowsAreTheReturnsOfTheMetaPolicyAfterTheRound) {
  const Experiment experiment = gridExperiment({"rounds:=1"});
  const LocalResult result = runLocally(experiment);
  Rng rng(0, 0, Stream::kMeasure);
  double sum = 0;
  for (int task = 0; task < 5; ++task) {
    sum += experiment.makeLearner(task)->evaluate(result.meta, rng).mean;
  }
  EXPECT_NEAR(result.rounds[0].summary.meta_return, sum / 5, 1e-12);
}

TEST(LocalRunner, StopsWhenToldSo) {
  std::vector<int> seen;
  const auto stopAt = [&](int round) {
    return [&seen, round](const RoundBook::Round& done) {
      seen.push_back(done.summary.round);
      return done.summary.round < round;
    };
  };
  const LocalResult result = runLocally(gridExperiment(), nullptr, stopAt(4));
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.rounds.size(), 4u);
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3, 4}));
  EXPECT_TRUE(result.meta == run({"rounds:=4"}).meta);

  EXPECT_FALSE(runLocally(gridExperiment(), nullptr, stopAt(10)).stopped)
      << "after the last round there is nothing left to stop";
  EXPECT_FALSE(run().stopped);
}

TEST(LocalRunner, LogsEveryRound) {
  const TempDir dir;
  const Experiment experiment = gridExperiment({"results_dir:=" + dir.path(), "rounds:=3"});
  RunLog log(experiment);
  const LocalResult result = runLocally(experiment, &log);
  std::string expected = std::string(RunLog::csvHeader()) + "\n";
  for (const auto& round : result.rounds) {
    for (const RoundRow& row : round.rows) expected += RunLog::csvLine(row) + "\n";
  }
  EXPECT_EQ(readFile(log.dir() + "/rounds.csv"), expected);
}

double largestGap(const Model& a, const Model& b) {
  double gap = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    gap = std::max(gap, std::abs(a.doubles()[k] - b.doubles()[k]));
  }
  return gap;
}

// With eta * lambda = 1 the auxiliary table equals the personal one after every batch. If no entry
// is drawn twice within a batch, every step then starts from a gap of zero, the pull never acts,
// and pMeta is model averaging. 0.009 samples an entry are one sample a batch on these grids.
const std::vector<std::string> kOneSampleBatches = {"sizes:=[4, 5, 6]", "samples_per_entry:=0.009",
                                                    "updates_per_round:=300", "rounds:=4"};

std::vector<std::string> with(std::vector<std::string> overrides,
                              const std::vector<std::string>& more) {
  overrides.insert(overrides.end(), more.begin(), more.end());
  return overrides;
}

TEST(Identity, PmetaIsModelAveragingWhereEtaLambdaIsOneAndNoEntryIsDrawnTwiceInABatch) {
  const LocalResult averaging = run(with(kOneSampleBatches, {"algorithm:=model_averaging"}));
  ASSERT_EQ(averaging.rounds[0].rows[0].env_steps, 300) << "one sample a batch";
  for (const std::string pull : {"lambda:=10", "lambda:=4"}) {
    const std::string eta = pull == "lambda:=10" ? "eta:=0.1" : "eta:=0.25";
    const LocalResult pmeta = run(with(kOneSampleBatches, {pull, eta}));
    EXPECT_LT(largestGap(pmeta.meta, averaging.meta), 1e-12) << pull;
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_NEAR(pmeta.rounds[c].summary.meta_return, averaging.rounds[c].summary.meta_return,
                  1e-9);
      EXPECT_NEAR(pmeta.rounds[c].summary.personal_return,
                  averaging.rounds[c].summary.personal_return, 1e-9);
    }
  }
  EXPECT_GT(largestGap(averaging.meta, Model(averaging.meta.layout)), 0.1) << "something is learnt";
}

TEST(Identity, FailsWhereOneOfItsConditionsDoes) {
  const LocalResult averaging = run(with(kOneSampleBatches, {"algorithm:=model_averaging"}));
  // eta * lambda below one; two batches before an auxiliary step; tables kept
  for (const std::vector<std::string>& broken :
       std::vector<std::vector<std::string>>{{"eta:=0.08"}, {"eta:=0.1", "personal_init:=keep"}}) {
    EXPECT_GT(largestGap(run(with(kOneSampleBatches, broken)).meta, averaging.meta), 1e-3)
        << join(broken);
  }
  const std::vector<std::string> two = with(kOneSampleBatches, {"q_learning.updates:=2"});
  EXPECT_GT(largestGap(run(with(two, {"eta:=0.1"})).meta,
                       run(with(two, {"algorithm:=model_averaging"})).meta),
            1e-6);
  // entries drawn twice in a batch feel the pull of their first step
  EXPECT_GT(largestGap(run({"eta:=0.1"}).meta, run({"algorithm:=model_averaging"}).meta), 1e-3);
}

}  // namespace
}  // namespace pmeta
