#include "pmeta_core/storage/best_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {
namespace {

using test::TempDir;
using testing::HasSubstr;

class BestPolicyTest : public testing::Test {
 protected:
  PolicyFile kept() const {
    return loadPolicy(policyPath(log_.dir(), Kept::kBest, PolicyKind::kPersonal, 1));
  }

  void offer(BestPolicy& best, int round, double mean_return) {
    PolicyOrigin origin{PolicyKind::kPersonal, 1, round};
    origin.mean_return = mean_return;
    best.offer(experiment_, origin, Model(ModelLayout(Precision::kFloat64, {{"values", {2}}})));
  }

  const TempDir dir_;
  const Experiment experiment_ =
      Experiment::parse("environment: {name: gridworld, sizes: [4, 5]}\nrun_id: run\nrounds: 6\n",
                        "test", {"results_dir:=" + dir_.path()});
  const RunLog log_{experiment_};
};

TEST_F(BestPolicyTest, IsTheEarliestOfTheHighestReturn) {
  BestPolicy best;
  for (const auto& [round, mean, holder] : std::vector<std::tuple<int, double, std::string>>{
           {1, -3, "1"}, {2, -3, "1"}, {3, -4, "1"}, {4, 0.1, "4"}, {5, 0, "4"}}) {
    offer(best, round, mean);
    EXPECT_EQ(kept().metadata.at("round"), holder) << "after round " << round;
  }
  EXPECT_EQ(kept().metadata.at("return"), "0.1");
  EXPECT_EQ(kept().metadata.at("run_id"), "run");
}

TEST_F(BestPolicyTest, OfAResumedRunIsWhatWasThereUntilItIsBeaten) {
  BestPolicy before;
  offer(before, 4, 2.5);
  BestPolicy resumed;
  offer(resumed, 3, 2.5);
  EXPECT_EQ(kept().metadata.at("round"), "4");
  offer(resumed, 5, 2.75);
  EXPECT_EQ(kept().metadata.at("round"), "5");
}

TEST_F(BestPolicyTest, RefusesAFileThatSaysNothingOfItsReturn) {
  const PolicyOrigin nameless{PolicyKind::kPersonal, 1, 2};
  saveRunPolicy(experiment_, Kept::kBest, nameless,
                Model(ModelLayout(Precision::kFloat64, {{"values", {2}}})));
  BestPolicy best;
  for (int attempt = 0; attempt < 2; ++attempt) {
    EXPECT_THAT(test::errorOf([&] { offer(best, 3, 1); }),
                HasSubstr("task_1.safetensors, does not say what its return was: move it"));
  }
}

}  // namespace
}  // namespace pmeta
