#include "pmeta_core/run/finished_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

using test::TempDir;
using testing::HasSubstr;

Experiment points(const std::string& folder, const std::string& task_encoding) {
  return Experiment::parse(
      "experiment: points\nrun_id: run\nlearner: sac\nrounds: 3\nupdates_per_round: 20\n"
      "personal: {alpha: 0.001, lambda: 15, eta: 0.01}\n"
      "sac: {hidden: [12, 10], batch_size: 16, buffer_size: 500, warm_up_steps: 40, "
      "context_hidden: [8], latent_size: 2, context_batch: 20, evaluation_episodes: 2, "
      "exploration_episodes: [1, 2], task_encoding: " +
          task_encoding +
          "}\nenvironment: {name: sparse_point_robot, train_tasks: 3, test_tasks: 2}\n",
      "points.yaml", {"results_dir:=" + folder});
}

std::vector<TaskReturn> lastReturns(const LocalResult& local, PolicyKind policy, int episodes) {
  std::vector<TaskReturn> found;
  for (const RoundRow& row : local.rounds.back().rows) {
    const TaskReturn& result = row.result;
    if (result.policy == policy && result.context_episodes == episodes) found.push_back(result);
  }
  return found;
}

// what the last round's evaluation gave, to the last digit
TEST(FinishedRun, PoliciesDoWhatTheyDidInTheLastRound) {
  for (const std::string encoding : {"one_hot", "model", "inference"}) {
    const TempDir dir;
    const Experiment experiment = points(dir.path(), encoding);
    RunLog log(experiment);
    const LocalResult result = runLocally(experiment, &log);
    const FinishedRun run(log.dir(), Kept::kLast);
    EXPECT_EQ(run.round(), 3);
    EXPECT_EQ(run.experiment().settings().run_id, "run");
    for (const TaskReturn& row : lastReturns(result, PolicyKind::kPersonal, 0)) {
      const std::optional<ShownPolicy> personal = run.personal(row.task);
      ASSERT_TRUE(personal.has_value());
      EXPECT_EQ(personal->result.mean, row.mean) << encoding << ", task " << row.task;
      EXPECT_EQ(personal->result.round, 3);
      EXPECT_EQ(personal->episode.rewards.size(), 20u);
    }
    const int explored = encoding == "one_hot" ? 0 : 2;
    const std::vector<TaskReturn> rows = lastReturns(result, PolicyKind::kMeta, explored);
    const std::vector<ShownPolicy> meta = run.meta();
    ASSERT_EQ(meta.size(), encoding == "one_hot" ? 3u : 5u);
    ASSERT_EQ(rows.size(), meta.size());
    for (std::size_t i = 0; i < meta.size(); ++i) {
      EXPECT_EQ(meta[i].result.task, rows[i].task);
      EXPECT_EQ(meta[i].result.mean, rows[i].mean) << encoding << ", task " << rows[i].task;
      EXPECT_EQ(meta[i].result.context_episodes, explored);
      EXPECT_EQ(meta[i].episode.task_weights.size(), encoding == "model" ? 3u : 0u);
    }
  }
}

// the first of the highest
struct Best {
  int round = 0;
  double mean = -std::numeric_limits<double>::infinity();

  void offer(int of, double value) {
    if (value > mean) *this = {of, value};
  }
};

TEST(FinishedRun, BestPoliciesDoWhatTheyDidInTheirRound) {
  const TempDir dir;
  const Experiment experiment = points(dir.path(), "one_hot");
  RunLog log(experiment);
  const LocalResult result = runLocally(experiment, &log);
  std::vector<Best> personal(3);
  Best meta;
  for (const RoundBook::Round& round : result.rounds) {
    meta.offer(round.summary.round, round.summary.meta_return);
    for (const RoundRow& row : round.rows) {
      if (row.result.policy != PolicyKind::kPersonal) continue;
      personal.at(static_cast<std::size_t>(row.result.task))
          .offer(row.result.round, row.result.mean);
    }
  }
  const FinishedRun run(log.dir(), Kept::kBest);
  for (int task = 0; task < 3; ++task) {
    const ShownPolicy shown = run.personal(task).value();
    EXPECT_EQ(shown.result.mean, personal[static_cast<std::size_t>(task)].mean);
    EXPECT_EQ(shown.result.round, personal[static_cast<std::size_t>(task)].round);
  }
  double sum = 0;
  for (const ShownPolicy& shown : run.meta()) {
    EXPECT_EQ(shown.result.round, meta.round);
    sum += shown.result.mean;
  }
  EXPECT_DOUBLE_EQ(sum / 3, meta.mean);
}

TEST(FinishedRun, MayLackPoliciesButNotAll) {
  const TempDir dir;
  const Experiment experiment = points(dir.path(), "one_hot");
  RunLog log(experiment);
  runLocally(experiment, &log);
  std::filesystem::remove(log.dir() + "/policies/meta.safetensors");
  std::filesystem::remove(log.dir() + "/policies/task_0.safetensors");
  const FinishedRun run(log.dir(), Kept::kLast);
  EXPECT_FALSE(run.personal(0).has_value());
  EXPECT_TRUE(run.personal(1).has_value());
  EXPECT_TRUE(run.meta().empty());
  std::filesystem::remove_all(log.dir() + "/policies");
  EXPECT_THAT(test::errorOf([&] { FinishedRun(log.dir(), Kept::kLast); }),
              HasSubstr("has no policies below policies/: only a run that is over keeps them."));
}

}  // namespace
}  // namespace pmeta
