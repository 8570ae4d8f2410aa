#include "pmeta_core/run/meta_aggregator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "../support.h"

namespace pmeta {
namespace {

using test::gridExperiment;
using Verdict = MetaAggregator::Verdict;
using Tasks = std::vector<int>;

// three small grids
Experiment smallExperiment(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(), "sizes:=[2, 3, 4]");
  return gridExperiment(overrides);
}

// a fitting update with random values on the entries the task owns
std::shared_ptr<AuxiliaryUpdate> makeUpdate(const Experiment& experiment, int task, int round,
                                            double weight = 1) {
  auto update = std::make_shared<AuxiliaryUpdate>();
  update->run_id = "run";
  update->settings_hash = experiment.settingsHash();
  update->task = task;
  update->round = round;
  update->weight = weight;
  update->model = experiment.makeLearner(task)->auxiliary();
  std::mt19937 random(task + 100 * round);
  std::normal_distribution<double> normal(0, 5);
  for (double& value : update->model.doubles()) value = normal(random);
  return update;
}

TEST(MetaAggregator, BeginsWithTheInitialModelOfRoundZero) {
  const MetaAggregator aggregator(smallExperiment({"initial_value:=-3"}));
  EXPECT_EQ(aggregator.metaPolicy().round, 0);
  EXPECT_EQ(aggregator.metaPolicy().run_id, "run");
  EXPECT_EQ(aggregator.metaPolicy().model.doubles(), std::vector<double>(64, -3.0));
  EXPECT_EQ(aggregator.metaPolicy().participants, Tasks{});
  EXPECT_EQ(aggregator.missing(), (Tasks{0, 1, 2}));
  EXPECT_EQ(aggregator.reported(), Tasks{});
}

TEST(MetaAggregator, MixesEachEntryOverItsOwners) {
  const Experiment experiment = smallExperiment({"beta:=0.5", "initial_value:=-3"});
  MetaAggregator aggregator(experiment);
  std::vector<std::shared_ptr<AuxiliaryUpdate>> updates;
  for (int task = 0; task < 3; ++task) {
    updates.push_back(makeUpdate(experiment, task, 1));
    EXPECT_EQ(aggregator.offer(updates.back()).verdict, Verdict::kAccepted);
  }
  EXPECT_TRUE(aggregator.complete());
  EXPECT_EQ(aggregator.closeRound(), Tasks{});
  EXPECT_EQ(aggregator.metaPolicy().round, 1);
  EXPECT_EQ(aggregator.metaPolicy().participants, (Tasks{0, 1, 2}));
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      for (int a = 0; a < 4; ++a) {
        const int k = (row * 4 + column) * 4 + a;
        double sum = 0;
        int owners = 0;
        for (int task = 0; task < 3; ++task) {
          const int size = 2 + task;
          if (std::max(row, column) >= size || std::min(row, column) == size - 1) continue;
          sum += updates[task]->model.doubles()[k];
          ++owners;
        }
        const double expected = owners == 0 ? -3 : 0.5 * -3 + 0.5 * sum / owners;
        EXPECT_NEAR(aggregator.metaPolicy().model.doubles()[k], expected, 1e-14);
      }
    }
  }
}

TEST(MetaAggregator, WeighsUpdatesByTheirWeight) {
  const Experiment experiment = gridExperiment({"sizes:=[2, 2]"});
  MetaAggregator aggregator(experiment);
  const auto a = makeUpdate(experiment, 0, 1, 3), b = makeUpdate(experiment, 1, 1, 1);
  aggregator.offer(a);
  aggregator.offer(b);
  aggregator.closeRound();
  for (int k = 0; k < 12; ++k) {
    EXPECT_NEAR(aggregator.metaPolicy().model.doubles()[k],
                (3 * a->model.doubles()[k] + b->model.doubles()[k]) / 4, 1e-14);
  }
}

TEST(MetaAggregator, ArrivalOrderDoesNotShowInTheBits) {
  const Experiment experiment = gridExperiment();
  Tasks order = {0, 1, 2, 3, 4};
  std::unique_ptr<Model> first;
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    MetaAggregator aggregator(experiment);
    for (int round = 1; round <= 2; ++round) {
      for (const int task : order) {
        aggregator.offer(makeUpdate(experiment, task, round, 1 + 0.1 * task));
      }
      aggregator.closeRound();
    }
    if (!first) first = std::make_unique<Model>(aggregator.metaPolicy().model);
    EXPECT_TRUE(aggregator.metaPolicy().model == *first);
    std::shuffle(order.begin(), order.end(), random);
  }
}

TEST(MetaAggregator, TheFirstUpdateOfATaskCounts) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment), reference(experiment);
  for (int task = 0; task < 3; ++task) {
    aggregator.offer(makeUpdate(experiment, task, 1));
    reference.offer(makeUpdate(experiment, task, 1));
  }
  auto second = makeUpdate(experiment, 1, 1);
  for (double& value : second->model.doubles()) value += 1;
  const auto answer = aggregator.offer(second);
  EXPECT_EQ(answer.verdict, Verdict::kDuplicate);
  EXPECT_EQ(answer.reason, "this round already has an update of the task.");
  aggregator.closeRound();
  reference.closeRound();
  EXPECT_TRUE(aggregator.metaPolicy().model == reference.metaPolicy().model);
  EXPECT_EQ(aggregator.counts()[1].accepted, 1);
  EXPECT_EQ(aggregator.counts()[1].duplicate, 1);
  EXPECT_EQ(aggregator.counts()[0].duplicate, 0);
}

TEST(MetaAggregator, UpdatesOfRoundsThatAreOverAreStale) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment);
  for (int task = 0; task < 3; ++task) aggregator.offer(makeUpdate(experiment, task, 1));
  aggregator.closeRound();
  const Model before = aggregator.metaPolicy().model;
  for (const int round : {1, 0, -4}) {
    const auto answer = aggregator.offer(makeUpdate(experiment, 2, round));
    EXPECT_EQ(answer.verdict, Verdict::kStale);
    EXPECT_EQ(answer.reason, "round " + std::to_string(round) + " is over.");
  }
  EXPECT_EQ(aggregator.counts()[2].stale, 3);
  EXPECT_EQ(aggregator.reported(), Tasks{});
  EXPECT_TRUE(aggregator.metaPolicy().model == before);
}

TEST(MetaAggregator, RefusesWhatDoesNotBelongAndSaysWhy) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment);
  const auto reasonFor = [&](auto&& spoil) {
    auto update = makeUpdate(experiment, 1, 1);
    spoil(*update);
    const auto answer = aggregator.offer(update);
    EXPECT_EQ(answer.verdict, Verdict::kRefused);
    return answer.reason;
  };
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.run_id = "other"; }),
            "task 1 belongs to run 'other', not to 'run'.");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.round = 2; }),
            "task 1 reports round 2 but round 1 is being trained.");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.weight = 0; }),
            "task 1 has weight 0, which is not a positive number.");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.weight = -2.5; }),
            "task 1 has weight -2.5, which is not a positive number.");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.weight = std::nan(""); }),
            "task 1 has weight nan, which is not a positive number.");
  EXPECT_NE(reasonFor([](AuxiliaryUpdate& u) { u.weight = HUGE_VAL; }), "");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.model.doubles()[0] = std::nan(""); }),
            "task 1 sent a value that is not finite (entry 0).");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.model.doubles().pop_back(); }),
            "task 1 sent 63 values where the layout has 64.");
  EXPECT_EQ(reasonFor([](AuxiliaryUpdate& u) { u.model.present.pop_back(); }),
            "task 1 sent a presence mask of 63 entries where the layout has 64.");
  EXPECT_NE(reasonFor([](AuxiliaryUpdate& u) { u.model = Model(); }), "");
  EXPECT_EQ(aggregator.counts()[1].refused, 10);
  EXPECT_EQ(aggregator.counts()[1].accepted, 0);
  EXPECT_EQ(aggregator.missing(), (Tasks{0, 1, 2}));

  // a refusal does not take the task's place
  EXPECT_EQ(aggregator.offer(makeUpdate(experiment, 1, 1)).verdict, Verdict::kAccepted);
}

TEST(MetaAggregator, CountsUnknownTasksApart) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment);
  for (const int task : {-1, 3, 1000000}) {
    auto update = makeUpdate(experiment, 0, 1);
    update->task = task;
    const auto answer = aggregator.offer(update);
    EXPECT_EQ(answer.verdict, Verdict::kRefused);
    EXPECT_EQ(answer.reason, "task " + std::to_string(task) + " is not one of this run's 3 tasks.");
  }
  EXPECT_EQ(aggregator.refusedUnknown(), 3);
  for (const auto& counts : aggregator.counts()) EXPECT_EQ(counts.refused, 0);
}

TEST(MetaAggregator, ClosesWithAQuorumAndNamesTheMissing) {
  const Experiment experiment = smallExperiment({"quorum:=2"});
  MetaAggregator aggregator(experiment);
  aggregator.offer(makeUpdate(experiment, 2, 1));
  EXPECT_FALSE(aggregator.hasQuorum());
  aggregator.offer(makeUpdate(experiment, 0, 1));
  EXPECT_TRUE(aggregator.hasQuorum());
  EXPECT_FALSE(aggregator.complete());
  EXPECT_EQ(aggregator.reported(), (Tasks{0, 2}));
  EXPECT_EQ(aggregator.missing(), Tasks{1});
  EXPECT_EQ(aggregator.closeRound(), Tasks{1});
  EXPECT_EQ(aggregator.metaPolicy().participants, (Tasks{0, 2}));
  EXPECT_EQ(aggregator.missing(), (Tasks{0, 1, 2})) << "the next round begins empty";
  EXPECT_FALSE(aggregator.hasQuorum());
}

TEST(MetaAggregator, WithoutQuorumSettingAllMustReport) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment);
  aggregator.offer(makeUpdate(experiment, 0, 1));
  aggregator.offer(makeUpdate(experiment, 1, 1));
  EXPECT_FALSE(aggregator.hasQuorum());
  aggregator.offer(makeUpdate(experiment, 2, 1));
  EXPECT_TRUE(aggregator.hasQuorum());
}

TEST(MetaAggregator, ClosingWithoutUpdatesIsAMistakeOfTheProgram) {
  MetaAggregator aggregator(smallExperiment());
  EXPECT_THROW(aggregator.closeRound(), std::logic_error);
  EXPECT_EQ(aggregator.metaPolicy().round, 0);
}

TEST(MetaAggregator, WithBetaZeroNothingComesBack) {
  const Experiment experiment = smallExperiment({"algorithm:=independent", "initial_value:=-3"});
  MetaAggregator aggregator(experiment);
  for (int task = 0; task < 3; ++task) aggregator.offer(makeUpdate(experiment, task, 1));
  const Model before = aggregator.metaPolicy().model;
  aggregator.closeRound();
  EXPECT_TRUE(aggregator.metaPolicy().model == before);
}

// the meta-policy moved by `distance` in one entry that the task owns
std::shared_ptr<AuxiliaryUpdate> makeStep(const Experiment& experiment,
                                          const MetaAggregator& aggregator, int task,
                                          double distance) {
  const MetaPolicy& meta = aggregator.metaPolicy();
  auto update = makeUpdate(experiment, task, meta.round + 1);
  const std::vector<std::uint8_t> present = update->model.present;
  update->model = meta.model;
  update->model.present = present;
  update->model.doubles()[0] += distance;
  // nobody owns what is not there
  for (std::size_t k = 0; k < present.size(); ++k) {
    if (present[k] == 0) update->model.doubles()[k] = 1e6;
  }
  return update;
}

TEST(MetaAggregator, MedianAndTrimmedMeanAreRules) {
  for (const std::string rule : {"median", "trimmed_mean"}) {
    const Experiment experiment =
        gridExperiment({"sizes:=[3, 3, 3, 3, 3]", "rule:=" + rule, "trim:=0.2", "beta:=0.5"});
    MetaAggregator aggregator(experiment);
    int task = 0;
    for (const double step : {4.0, 1.0, -1e9, 2.0, 1e9}) {
      aggregator.offer(makeStep(experiment, aggregator, task++, step));
    }
    aggregator.closeRound();
    const double expected = rule == "median" ? 2 : 7.0 / 3;
    EXPECT_NEAR(aggregator.metaPolicy().model.doubles()[0], 0.5 * expected, 1e-12) << rule;
    EXPECT_EQ(aggregator.metaPolicy().participants, (Tasks{0, 1, 2, 3, 4}));
  }
}

TEST(MetaAggregator, RobustRulesTakeNoOtherWeightThanOne) {
  const Experiment experiment = smallExperiment({"rule:=median"});
  MetaAggregator aggregator(experiment);
  const auto answer = aggregator.offer(makeUpdate(experiment, 1, 1, 2));
  EXPECT_EQ(answer.verdict, Verdict::kRefused);
  EXPECT_EQ(answer.reason,
            "task 1 has weight 2 but aggregation.rule median counts all tasks the same: start it "
            "with the same configuration.");
  EXPECT_EQ(aggregator.counts()[1].last_reason, answer.reason);
}

TEST(MetaAggregator, LeavesOutWhatIsTooFarAndDoesNotWaitForIt) {
  const Experiment experiment = smallExperiment({"max_update_norm:=10"});
  MetaAggregator aggregator(experiment);
  int task = 0;
  for (const double step : {4.0, 10.5, 6.0}) {
    EXPECT_EQ(aggregator.offer(makeStep(experiment, aggregator, task++, step)).verdict,
              Verdict::kAccepted);
  }
  EXPECT_TRUE(aggregator.complete());
  EXPECT_EQ(aggregator.closeRound(), Tasks{});
  EXPECT_EQ(aggregator.metaPolicy().round, 1);
  EXPECT_EQ(aggregator.metaPolicy().participants, (Tasks{0, 2}));
  EXPECT_EQ(aggregator.metaPolicy().model.doubles()[0], 5);
  EXPECT_EQ(aggregator.excluded(), Tasks{1});
  EXPECT_EQ(aggregator.exclusions()[0].reason,
            "its distance to the meta-policy, 10.5, is above aggregation.max_update_norm, 10");
  EXPECT_EQ(aggregator.counts()[1].accepted, 1);
  EXPECT_EQ(aggregator.counts()[1].excluded, 1);
  EXPECT_EQ(aggregator.counts()[1].last_reason, aggregator.exclusions()[0].reason);
  EXPECT_EQ(aggregator.counts()[0].excluded, 0);

  // the next round begins with a clean slate, and norms from the new meta-policy
  for (task = 0; task < 3; ++task) aggregator.offer(makeStep(experiment, aggregator, task, 9));
  aggregator.closeRound();
  EXPECT_EQ(aggregator.excluded(), Tasks{});
  EXPECT_EQ(aggregator.metaPolicy().model.doubles()[0], 14);
}

TEST(MetaAggregator, WhatIsLeftOutDoesNotDependOnTheOrderOfArrival) {
  const Experiment experiment = gridExperiment({"outlier_factor:=2"});
  Tasks order = {0, 1, 2, 3, 4};
  const std::vector<double> steps = {1, 2.5, 1.2, -1.1, 3};
  std::mt19937 random(2);
  for (int i = 0; i < 20; ++i) {
    MetaAggregator aggregator(experiment);
    for (const int task : order) {
      aggregator.offer(makeStep(experiment, aggregator, task, steps[task]));
    }
    aggregator.closeRound();
    EXPECT_EQ(aggregator.excluded(), (Tasks{1, 4})) << "the median is 1.2";
    std::shuffle(order.begin(), order.end(), random);
  }
}

TEST(MetaAggregator, IfAllAreLeftOutTheMetaPolicyStays) {
  for (const std::string rule : {"mean", "median"}) {
    const Experiment experiment = smallExperiment({"max_update_norm:=1", "rule:=" + rule});
    MetaAggregator aggregator(experiment);
    const Model before = aggregator.metaPolicy().model;
    for (int task = 0; task < 3; ++task) {
      aggregator.offer(makeStep(experiment, aggregator, task, 5));
    }
    aggregator.closeRound();
    EXPECT_TRUE(aggregator.metaPolicy().model == before);
    EXPECT_EQ(aggregator.metaPolicy().round, 1);
    EXPECT_EQ(aggregator.metaPolicy().participants, Tasks{});
    EXPECT_EQ(aggregator.excluded(), (Tasks{0, 1, 2}));
  }
}

TEST(MetaAggregator, CountsRefusalsMadeBeforeTheOffer) {
  MetaAggregator aggregator(smallExperiment());
  aggregator.countRefusal(1, "a model's checksum does not fit.");
  aggregator.countRefusal(3, "of nobody");
  aggregator.countRefusal(-1, "of nobody");
  EXPECT_EQ(aggregator.counts()[1].refused, 1);
  EXPECT_EQ(aggregator.counts()[1].last_reason, "a model's checksum does not fit.");
  EXPECT_EQ(aggregator.counts()[0].last_reason, "");
  EXPECT_EQ(aggregator.refusedUnknown(), 2);
}

TEST(MetaAggregator, RefusesAnAgentOfOtherSettings) {
  const Experiment experiment = smallExperiment(), other = smallExperiment({"lambda:=0.01"});
  ASSERT_NE(experiment.settingsHash(), other.settingsHash());
  EXPECT_EQ(experiment.settingsHash(), smallExperiment({"pace:=3"}).settingsHash());
  MetaAggregator aggregator(experiment);
  const auto answer = aggregator.offer(makeUpdate(other, 1, 1));
  EXPECT_EQ(answer.verdict, Verdict::kRefused);
  EXPECT_NE(answer.reason.find("task 1 has other settings, of hash '" +
                               other.settingsHash().substr(0, 20)),
            std::string::npos)
      << answer.reason;
  EXPECT_NE(answer.reason.find("same settings file"), std::string::npos) << answer.reason;
}

TEST(MetaAggregator, ShowsAStrangersTextShortAndWithoutControlCharacters) {
  const Experiment experiment = smallExperiment();
  MetaAggregator aggregator(experiment);
  auto update = makeUpdate(experiment, 0, 1);
  update->run_id = "Z\n\x1b[31m[FATAL] forged" + std::string(1000000, 'z');
  const std::string reason = aggregator.offer(update).reason;
  EXPECT_LT(reason.size(), 200u);
  EXPECT_EQ(reason.find_first_of("\n\x1b"), std::string::npos) << reason;
}

TEST(MetaAggregator, ARunWhoseTaskHasFailedGoesOnWithAQuorumAlone) {
  MetaAggregator all(smallExperiment());
  EXPECT_EQ(all.hopeless(), "");
  EXPECT_TRUE(all.giveUp(1, "task 1 failed."));
  EXPECT_FALSE(all.giveUp(1, "task 1 failed once more.")) << "it is known";
  EXPECT_EQ(all.hopeless(), "task 1 failed.");

  MetaAggregator two(smallExperiment({"quorum:=2"}));
  two.giveUp(2, "task 2 failed.");
  EXPECT_EQ(two.hopeless(), "") << "two of three are left";
  two.giveUp(3, "a test task failed.");
  EXPECT_EQ(two.hopeless(), "") << "it has no update to give";
  two.giveUp(0, "task 0 failed.");
  EXPECT_EQ(two.hopeless(), "task 0 failed.");

  MetaAggregator tested(smallExperiment());
  tested.giveUp(3, "a test task failed.");
  EXPECT_EQ(tested.hopeless(), "a test task failed.") << "its returns are waited for";
}

}  // namespace
}  // namespace pmeta
