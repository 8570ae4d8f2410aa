#include <std_srvs/Trigger.h>

#include <filesystem>

#include "pmeta_core/storage/checkpoint.h"
#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

std_srvs::Trigger::Response saveCheckpoint() {
  std_srvs::Trigger service;
  EXPECT_TRUE(ros::service::waitForService("/pmeta/save_checkpoint", 20000));
  EXPECT_TRUE(ros::service::call("/pmeta/save_checkpoint", service));
  return service.response;
}

// without it nobody saves one here
TEST_F(RunOverRos, AllSaveACheckpointOfOneRoundWhenAsked) {
  const std::string folder = experiment_.runDir() + "/checkpoint";
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 2; }));
  EXPECT_FALSE(std::filesystem::exists(folder));
  const std_srvs::Trigger::Response answer = saveCheckpoint();
  EXPECT_TRUE(answer.success) << answer.message;
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectEqualsLocal();

  std::vector<pmeta::CheckpointFolder> folders;
  const pmeta::ModelLayout layout = experiment_.makeLearner(0)->layout();
  folders.emplace_back(experiment_, pmeta::kAggregator, layout);
  for (int task = 0; task < experiment_.numTasks(); ++task) {
    folders.emplace_back(experiment_, task, layout);
  }
  std::vector<std::string> refused;
  EXPECT_GE(pmeta::newestCommonRound(folders, refused), 3);
  EXPECT_TRUE(refused.empty()) << refused.front();
  EXPECT_FALSE(saveCheckpoint().success) << "the rounds are over";
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("save_checkpoint_test")
