#include "view/mountain_car_scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

class MountainCarSceneTest : public ::testing::Test {
 protected:
  /// From -0.5 to the right by 0.05 a step.
  static Trajectory drive(int task, int policy, int steps) {
    std::vector<double> observations;
    for (int i = 0; i <= steps; ++i) {
      observations.insert(observations.end(), {-0.5 + 0.05 * i, 15 * 0.035});
    }
    return episodeOf(task, policy, 2, observations);
  }

  const pmeta::Experiment experiment_ =
      experiment("environment: {name: mountain_car, velocity_scale: 15}\nlearner: dqn");
  const std::unique_ptr<Scene> scene_ = makeScene(experiment_);
  SceneContent content_ = contentOf(5);
  std::vector<double> start_ = std::vector<double>(5, 0.0);
  const MountainCarScene& cars() const { return dynamic_cast<const MountainCarScene&>(*scene_); }
};

TEST_F(MountainCarSceneTest, KeepsTheSameMarkersWhateverIsKnown) {
  const auto still = names(scene_->still(content_));
  const auto moving = names(scene_->moving(content_, start_));
  content_.tasks[0].personal.episode = shared(drive(0, Trajectory::PERSONAL, 20));
  content_.tasks[3].meta.episode = shared(drive(3, Trajectory::META, 20));
  EXPECT_EQ(still, names(scene_->still(content_)));
  EXPECT_EQ(moving, names(scene_->moving(content_, start_)));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
}

TEST_F(MountainCarSceneTest, TheCarStandsOnTheHillAlongItsSlope) {
  content_.tasks[4].meta.episode = shared(drive(4, Trajectory::META, 10));
  start_[4] = 4 * MountainCarScene::kTimeStep;
  const double position = -0.5 + 0.05 * 4;
  const double zeta = 5;
  const Marker car = find(scene_->moving(content_, start_), "cars", 9);
  EXPECT_EQ("task_4/hill", car.header.frame_id);
  EXPECT_DOUBLE_EQ(position * cars().scale(), car.pose.position.x);
  EXPECT_DOUBLE_EQ((0.45 * std::sin(zeta * position) + 0.55) * cars().scale(), car.pose.position.y);
  const double angle = 2 * std::atan2(car.pose.orientation.z, car.pose.orientation.w);
  EXPECT_NEAR(0.45 * zeta * std::cos(zeta * position), std::tan(angle), 1e-12);

  // the crest of the drawn hill, below the car
  const Marker hill = find(scene_->still(content_), "hills", 4);
  double crest = 0;
  for (const auto& point : hill.points) {
    if (std::abs(point.x - car.pose.position.x) < 0.012 * cars().scale()) {
      crest = std::max(crest, point.y);
    }
  }
  EXPECT_NEAR(car.pose.position.y, crest, 0.04 * cars().scale());
}

TEST_F(MountainCarSceneTest, ThePhasePlotHasUnscaledVelocities) {
  content_.tasks[1].personal.episode = shared(drive(1, Trajectory::PERSONAL, 10));
  const Marker dot = find(scene_->moving(content_, start_), "dots", 2);
  EXPECT_EQ("task_1/phase", dot.header.frame_id);
  EXPECT_NEAR(0.035 * cars().velocityScale(), dot.pose.position.y, 1e-12);
  EXPECT_LT(dot.pose.position.x, 0);
  const Marker plane = find(scene_->still(content_), "planes", 1);
  double top = 0;
  for (const auto& point : plane.points) top = std::max(top, point.y);
  EXPECT_NEAR(2 * dot.pose.position.y, top, 0.02 * cars().scale()) << "0.07 is the highest speed";
}

TEST_F(MountainCarSceneTest, SaysWhenTheGoalIsReached) {
  Trajectory message = drive(0, Trajectory::PERSONAL, 20);
  content_.tasks[0].personal.episode = shared(message);
  start_[0] = 100;
  EXPECT_EQ("goal not reached by step 20", find(scene_->moving(content_, start_), "steps", 0).text);
  message.terminated = true;
  content_.tasks[0].personal.episode = shared(message);
  EXPECT_EQ("goal at step 20", find(scene_->moving(content_, start_), "steps", 0).text);
}

TEST_F(MountainCarSceneTest, LongEpisodesDoNotMakeLongMessages) {
  content_.tasks[0].meta.episode = shared(drive(0, Trajectory::META, 249));
  const std::size_t length = lengthOf(scene_->still(content_));
  content_.tasks[0].meta.episode = shared(drive(0, Trajectory::META, 20000));
  EXPECT_LE(lengthOf(scene_->still(content_)), length);
}

}  // namespace
}  // namespace pmeta_nodes
