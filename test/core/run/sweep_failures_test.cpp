#include <gtest/gtest.h>

#include <atomic>
#include <nlohmann/json.hpp>

#include "../support.h"
#include "pmeta_core/run/sweep.h"

namespace pmeta {
namespace {

using test::readFile;
using test::TempDir;

std::string settingsFile(const TempDir& dir) {
  test::writeFile(dir / "cart.yaml",
                  "experiment: cart\nlearner: dqn\nrounds: 2\nupdates_per_round: 12\n"
                  "results_dir: " +
                      dir.path() +
                      "\n"
                      "dqn: {hidden: [4], batch_size: 4, num_envs: 1, warm_up_steps: 10, "
                      "evaluation_episodes: 1}\n"
                      "environment: {name: cart_pole, force_mag: [10], masspole: [0.1], "
                      "length: [0.5]}\n");
  return dir / "cart.yaml";
}

TEST(SweepFailures, OneBadCombinationKeepsNoOtherFromBeingRun) {
  const TempDir dir;
  const SweepPlan plan = {"rates", settingsFile(dir), {"learning_rate:=0.001,1e30,0.002"}, 1};
  const std::atomic<bool> stop{false};
  int finished = 0;
  int found = 0;
  const auto count = [&](const SweepProgress& progress) {
    ++(progress.skipped ? found : finished);
  };
  const SweepResult result = runSweep(plan, stop, count);
  EXPECT_EQ(finished, 2);
  ASSERT_EQ(result.failures.size(), 1u);
  EXPECT_NE(result.failures[0].run_id.find("1e"), std::string::npos);
  EXPECT_NE(result.failures[0].reason.find("failed in round 1"), std::string::npos)
      << result.failures[0].reason;
  const auto manifest = nlohmann::json::parse(
      readFile(result.folder + "/cart/" + result.failures[0].run_id + "/manifest.json"));
  EXPECT_EQ(manifest["status"], "failed");
  EXPECT_EQ(manifest["reason"], result.failures[0].reason);

  const SweepResult again = runSweep(plan, stop, count);
  EXPECT_EQ(finished, 2) << "only what failed is tried again";
  EXPECT_EQ(found, 2);
  EXPECT_EQ(again.failures.size(), 1u);
}

}  // namespace
}  // namespace pmeta
