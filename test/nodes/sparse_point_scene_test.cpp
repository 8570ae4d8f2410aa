#include "view/sparse_point_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

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

TEST_F(SparsePointSceneTest, ActionValuesAreAMapWithTheActionTaken) {
  Trajectory episode = climb(0, Trajectory::META, 4);
  episode.action_size = 2;
  episode.actions.assign(8, 0);
  episode.actions[0] = 1;
  episode.actions[1] = -0.5;
  episode.action_grid = 3;
  episode.action_values = {0, 1, 2, 3, 4, 5, 6, 7, -2};  // rows from y = -1 to 1
  EXPECT_EQ("", scene_->problem(episode));
  content_.tasks[0].meta.episode = shared(episode);
  const MarkerArray scene = scene_->still(content_);
  EXPECT_EQ("", complaint(*scene_, scene));
  const Marker cells = find(scene, "action values", 1);
  EXPECT_EQ(Marker::POINTS, cells.type);
  EXPECT_EQ("task_0/plane", cells.header.frame_id);
  ASSERT_EQ(9u, cells.points.size());
  EXPECT_EQ(viridis(1), cells.colors[7]) << "the highest, at x = 0, y = 1";
  EXPECT_EQ(viridis(0), cells.colors[8]) << "the lowest, at x = 1, y = 1";
  EXPECT_EQ(viridis(2.0 / 9), cells.colors[0]);
  EXPECT_LT(cells.points[7].x, cells.points[8].x);
  EXPECT_LT(cells.points[5].y, cells.points[8].y);
  EXPECT_GT(cells.points[0].x, 1.25 * scale()) << "beside the plane";
  EXPECT_EQ("7", find(scene, "action value texts", 4).text);
  EXPECT_EQ("-2", find(scene, "action value texts", 5).text);

  // the dot's middle: in the last column, between the first and second row
  double x = 0, y = 0, n = 0;
  for (const auto& point : find(scene, "action value axes", 1).points) {
    if (point.z < 0.155) continue;
    x += point.x;
    y += point.y;
    ++n;
  }
  ASSERT_GT(n, 0);
  EXPECT_NEAR(cells.points[2].x, x / n, 1e-3);
  EXPECT_NEAR((cells.points[2].y + cells.points[5].y) / 2, y / n, 1e-3);
  EXPECT_EQ(Marker::DELETE, find(scene, "action values", 0).action) << "personal: nothing yet";
}

TEST_F(SparsePointSceneTest, ActionValuesThatDoNotFitAreRefused) {
  const auto problem = [&](const std::function<void(Trajectory&)>& spoil) {
    Trajectory episode = climb(0, Trajectory::META, 4);
    episode.action_grid = 2;
    episode.action_values = {1, 2, 3, 4};
    spoil(episode);
    return scene_->problem(episode);
  };
  EXPECT_EQ("", problem([](Trajectory&) {}));
  EXPECT_NE("", problem([](Trajectory& e) { e.action_values.pop_back(); }));
  EXPECT_NE("", problem([](Trajectory& e) { e.action_grid = 0; }));
  EXPECT_NE("", problem([](Trajectory& e) {
              e.action_grid = 1;
              e.action_values = {1};
            }));
  EXPECT_NE("", problem([](Trajectory& e) {
              e.action_grid = 65536;
              e.action_values.clear();
            }));
  EXPECT_EQ("it holds an action value that is not finite.",
            problem([](Trajectory& e) { e.action_values[1] = NAN; }));
  EXPECT_EQ("it holds an action that is not finite.",
            problem([](Trajectory& e) { e.actions[1] = NAN; }));
}

TEST_F(SparsePointSceneTest, ManyTasksKeepMapsSmall) {
  const pmeta::Experiment many = experiment(
      "environment: {name: sparse_point_robot, train_tasks: 200, test_tasks: 0}\nlearner: sac");
  const auto scene = makeScene(many);
  SceneContent content = contentOf(200);
  const auto without = lengthOf(scene->still(content));
  for (int task = 0; task < 200; ++task) {
    Trajectory episode = climb(task, Trajectory::PERSONAL, 1);
    episode.action_grid = 64;
    episode.action_values.assign(64 * 64, 1);
    content.tasks[task].personal.episode = shared(episode);
  }
  EXPECT_LT(lengthOf(scene->still(content)), without + 30000 + 200 * 250);
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
