#include "sparse_point_scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

class SparsePointSceneTest : public ::testing::Test {
 protected:
  /// Straight up by 0.1 a step.
  static Trajectory climb(int task, int policy, int steps) {
    std::vector<double> observations;
    for (int i = 0; i <= steps; ++i) observations.insert(observations.end(), {0, 0.1 * i});
    return episodeOf(task, policy, 2, observations);
  }

  // goals on the right, at the top; and for test at the top
  const pmeta::Experiment experiment_ = experiment(
      "environment: {name: sparse_point_robot, goal_angles: [0, 1.5707963267948966],"
      " test_goal_angles: [1.5707963267948966]}\nlearner: sac\nsac: {task_encoding: inference}");
  const std::unique_ptr<Scene> scene_ = makeScene(experiment_);
  SceneContent content_ = contentOf(3);
  std::vector<double> start_ = std::vector<double>(3, 0.0);
  double scale() const { return dynamic_cast<const SparsePointScene&>(*scene_).scale(); }
};

TEST_F(SparsePointSceneTest, KeepsTheSameMarkersWhateverIsKnown) {
  const auto still = names(scene_->still(content_));
  const auto moving = names(scene_->moving(content_, start_));
  content_.tasks[0].personal.episode = shared(climb(0, Trajectory::PERSONAL, 20));
  content_.tasks[2].meta.episode = shared(climb(2, Trajectory::META, 20));
  start_ = {100, 100, 100};
  EXPECT_EQ(still, names(scene_->still(content_)));
  EXPECT_EQ(moving, names(scene_->moving(content_, start_)));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
}

TEST_F(SparsePointSceneTest, ThePointIsWhereTheStateSays) {
  content_.tasks[1].meta.episode = shared(climb(1, Trajectory::META, 10));
  start_[1] = 6 * SparsePointScene::kTimeStep;
  const MarkerArray markers = scene_->moving(content_, start_);
  const Marker& point = find(markers, "points", 3);
  EXPECT_EQ("task_1/plane", point.header.frame_id);
  EXPECT_DOUBLE_EQ(0, point.pose.position.x);
  EXPECT_DOUBLE_EQ(0.6 * scale(), point.pose.position.y);
  EXPECT_EQ("step 6", find(markers, "steps", 3).text);
}

TEST_F(SparsePointSceneTest, TheGoalIsFilledOnceItIsReached) {
  content_.tasks[1].meta.episode = shared(climb(1, Trajectory::META, 20));
  const auto fill = [&](int steps) {
    start_[1] = steps * SparsePointScene::kTimeStep;
    return find(scene_->moving(content_, start_), "fills", 3);
  };
  EXPECT_EQ(Marker::DELETE, fill(7).action);
  // the goal is at 1, its radius 0.2; a step more for rounding
  const Marker filled = fill(9);
  EXPECT_EQ(Marker::ADD, filled.action);
  for (const auto& point : filled.points) {
    EXPECT_LE(std::hypot(point.x, point.y - scale()), 0.2 * scale());
    EXPECT_GE(point.x, -1e-12) << "meta's half is the right one";
  }
  EXPECT_EQ(Marker::ADD, fill(20).action) << "it stays so when the point has passed by";
}

TEST_F(SparsePointSceneTest, ATestTasksGoalIsFilledWhole) {
  content_.tasks[2].meta.episode = shared(climb(2, Trajectory::META, 20));
  start_[2] = 100;
  double left = 0;
  for (const auto& point : find(scene_->moving(content_, start_), "fills", 5).points) {
    left = std::min(left, point.x);
  }
  EXPECT_LT(left, -0.1 * scale());
}

TEST_F(SparsePointSceneTest, PathsBeyondTheCardEndOnItsEdge) {
  content_.tasks[0].personal.episode = shared(climb(0, Trajectory::PERSONAL, 100));
  const double top = scale() * 1.3 + 0.05 * scale();
  for (const auto& point : find(scene_->still(content_), "paths", 0).points) {
    EXPECT_LE(point.y, top);
  }
}

TEST_F(SparsePointSceneTest, ManyTasksKeepGoalsFew) {
  const auto length = [](int tasks) {
    const pmeta::Experiment many =
        experiment("environment: {name: sparse_point_robot, train_tasks: " + std::to_string(tasks) +
                   ", test_tasks: 0}\nlearner: sac");
    const auto scene = makeScene(many);
    return static_cast<double>(lengthOf(scene->still(contentOf(tasks)))) / tasks;
  };
  EXPECT_LT(length(96), 1.2 * length(24));
}

}  // namespace
}  // namespace pmeta_nodes
