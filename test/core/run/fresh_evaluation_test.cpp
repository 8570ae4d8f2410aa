#include "pmeta_core/run/fresh_evaluation.h"

#include <gtest/gtest.h>

#include <map>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

Experiment deep(const std::vector<std::string>& overrides) {
  return Experiment::parse(
      "learner: dqn\nenvironment: {name: cart_pole, force_mag: [10, 5], masspole: 0.1, length: "
      "0.5}\nrounds: 4\nupdates_per_round: 30\npersonal: {alpha: 0.001, lambda: 20, eta: 0.01}\n"
      "dqn: {hidden: [16], num_envs: 2}\nrun_id: r\nfresh_episodes: 25\n",
      "test", overrides);
}

TEST(FreshEvaluation, GivesEveryKeptPolicyOnItsTasks) {
  const LocalResult result = runLocally(deep({}));
  std::map<std::pair<std::string, PolicyKind>, int> rows;
  for (const FreshReturn& row : result.fresh) {
    ++rows[{row.snapshot, row.policy}];
    EXPECT_GE(row.stats.episodes, 25);
    EXPECT_GE(row.stats.mean, 1);
    EXPECT_LE(row.stats.mean, 200);
    if (row.policy == PolicyKind::kPersonal) {
      EXPECT_EQ(row.trained_task, row.task);
    }
    if (row.policy == PolicyKind::kMeta) {
      EXPECT_EQ(row.trained_task, -1);
    }
    if (row.snapshot == "last") {
      EXPECT_EQ(row.round, 4);
    }
  }
  EXPECT_EQ(rows.size(), 5u);
  for (const auto& entry : rows) EXPECT_EQ(entry.second, 2);
}

TEST(FreshEvaluation, TheBestRoundIsTheOneOfTheHighestMean) {
  const LocalResult result = runLocally(deep({}));
  int best = 0;
  double value = -1;
  for (const auto& round : result.rounds) {
    if (round.summary.personal_return > value) {
      value = round.summary.personal_return;
      best = round.summary.round;
    }
  }
  for (const FreshReturn& row : result.fresh) {
    if (row.snapshot == "best" && row.policy == PolicyKind::kPersonal) {
      EXPECT_EQ(row.round, best);
    }
  }
}

TEST(FreshEvaluation, OwnBestIsEachTasksBestRound) {
  const LocalResult result = runLocally(deep({}));
  std::map<int, std::pair<double, int>> best;
  for (const auto& round : result.rounds) {
    for (const RoundRow& row : round.rows) {
      if (row.result.policy != PolicyKind::kPersonal) continue;
      auto& entry = best.emplace(row.result.task, std::make_pair(-1.0, 0)).first->second;
      if (row.result.mean > entry.first) entry = {row.result.mean, row.result.round};
    }
  }
  int seen = 0;
  for (const FreshReturn& row : result.fresh) {
    if (row.snapshot != "own_best") continue;
    ++seen;
    EXPECT_EQ(row.round, best.at(row.task).second);
    EXPECT_EQ(row.trained_task, row.task);
  }
  EXPECT_EQ(seen, 2);
}

TEST(FreshEvaluation, IndependentPoliciesAreCrossedAndHaveNoMeta) {
  const LocalResult result = runLocally(deep({"algorithm:=independent"}));
  EXPECT_EQ(result.fresh.size(), 2u * 2 * 2 + 2);
  for (const FreshReturn& row : result.fresh) EXPECT_EQ(row.policy, PolicyKind::kPersonal);
}

TEST(FreshEvaluation, ChangesNothingOfTheRun) {
  const LocalResult with = runLocally(deep({}));
  const LocalResult without = runLocally(deep({"fresh_episodes:=0"}));
  EXPECT_TRUE(with.meta == without.meta);
  EXPECT_TRUE(without.fresh.empty());
}

TEST(FreshEvaluation, FreshEpisodesAreNotThoseOfTheRounds) {
  const Experiment experiment = deep({});
  TaskAgent agent(experiment, 0);
  const MetaAggregator aggregator(experiment);
  const Model& policy = aggregator.metaPolicy().model;
  // ten starts against a hundred others: equal means would be a coincidence
  EXPECT_NE(agent.evaluateFresh(PolicyKind::kPersonal, policy, 100).mean,
            agent.evaluateMeta(aggregator.metaPolicy()).front().mean);
  EXPECT_EQ(agent.evaluateFresh(PolicyKind::kPersonal, policy, 100).episodes, 100);
  EXPECT_EQ(agent.evaluateFresh(PolicyKind::kPersonal, policy, 100).mean,
            agent.evaluateFresh(PolicyKind::kPersonal, policy, 100).mean);
}

TEST(FreshEvaluation, WritesOneLineForEachRow) {
  EXPECT_EQ(FreshEvaluation::csv(
                {{"best", 3, PolicyKind::kPersonal, 1, 0, Split::kTrain, {-1.5, 0.25, 100}},
                 {"last", 4, PolicyKind::kMeta, -1, 2, Split::kTest, {200, 0, 100}}}),
            "snapshot,round,policy,trained_task,task,split,return_mean,return_std,episodes\n"
            "best,3,personal,1,0,train,-1.5,0.25,100\n"
            "last,4,meta,-1,2,test,200,0,100\n");
}

}  // namespace
}  // namespace pmeta
