#include "view/cart_pole_scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

class CartPoleSceneTest : public ::testing::Test {
 protected:
  /// The cart moves to the right by 0.1 m a step, the pole turns to 0.02 rad a step.
  static Trajectory drive(int task, int policy, int steps) {
    std::vector<double> observations;
    for (int i = 0; i <= steps; ++i) {
      observations.insert(observations.end(), {0.1 * i, 5, 0.02 * i, 1});
    }
    return episodeOf(task, policy, 4, observations);
  }

  const pmeta::Experiment experiment_ = experiment("environment: {name: cart_pole}\nlearner: dqn");
  const std::unique_ptr<Scene> scene_ = makeScene(experiment_);
  SceneContent content_ = contentOf(5);
  std::vector<double> start_ = std::vector<double>(5, 0.0);
  double scale() const { return dynamic_cast<const CartPoleScene&>(*scene_).scale(); }
};

TEST_F(CartPoleSceneTest, KeepsTheSameMarkersWhateverIsKnown) {
  const auto still = names(scene_->still(content_));
  const auto moving = names(scene_->moving(content_, start_));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  content_.tasks[1].personal.episode = shared(drive(1, Trajectory::PERSONAL, 20));
  content_.tasks[4].meta.episode = shared(drive(4, Trajectory::META, 20));
  EXPECT_EQ(still, names(scene_->still(content_)));
  EXPECT_EQ(moving, names(scene_->moving(content_, start_)));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
}

TEST_F(CartPoleSceneTest, PutsTheCartAndPoleWhereTheStateSays) {
  content_.tasks[2].personal.episode = shared(drive(2, Trajectory::PERSONAL, 10));
  start_[2] = 5.5 * 0.02;  // after five steps, before the sixth
  const MarkerArray markers = scene_->moving(content_, start_);
  const int id = 4;
  const Marker& cart = find(markers, "carts", id);
  EXPECT_EQ("task_2/personal", cart.header.frame_id);
  EXPECT_DOUBLE_EQ(0.5 * scale(), cart.pose.position.x);
  EXPECT_DOUBLE_EQ(0, cart.pose.position.y);
  const Marker& pole = find(markers, "poles", id);
  EXPECT_DOUBLE_EQ(0.5 * scale(), pole.pose.position.x);
  EXPECT_DOUBLE_EQ(CartPoleScene::kCartHeight * scale(), pole.pose.position.y);
  // a positive angle leans to the right: clockwise in the picture
  EXPECT_DOUBLE_EQ(-0.1, 2 * std::atan2(pole.pose.orientation.z, pole.pose.orientation.w));
  double tip = 0;
  for (const auto& point : pole.points) tip = std::max(tip, point.y);
  EXPECT_DOUBLE_EQ(2 * 0.5 * scale(), tip) << "twice the half length";
  EXPECT_EQ("step 5", find(markers, "steps", id).text);
  EXPECT_EQ(Marker::DELETE, find(markers, "carts", id + 1).action) << "meta has no episode";
}

TEST_F(CartPoleSceneTest, DrawsPolesToScale) {
  content_.tasks[4].meta.episode = shared(drive(4, Trajectory::META, 1));
  const MarkerArray markers = scene_->moving(content_, start_);
  double tip = 0;
  for (const auto& point : find(markers, "poles", 9).points) tip = std::max(tip, point.y);
  EXPECT_DOUBLE_EQ(0.1 * scale(), tip);
}

TEST_F(CartPoleSceneTest, PoliciesDifferInColourAndFallenPolesFromBoth) {
  content_.tasks[0].personal.episode = shared(drive(0, Trajectory::PERSONAL, 20));
  content_.tasks[0].meta.episode = shared(drive(0, Trajectory::META, 20));
  const auto color = [&](int id) {
    return find(scene_->moving(content_, start_), "carts", id).colors.front();
  };
  EXPECT_GT(color(0).r, color(0).b);
  EXPECT_GT(color(1).b, color(1).r);
  start_[0] = 100;  // the end: an angle of 0.4
  EXPECT_EQ(color(0).r, color(0).b);
  EXPECT_EQ("fell at step 20", find(scene_->moving(content_, start_), "steps", 0).text);
}

TEST_F(CartPoleSceneTest, ACartThatLeavesItsTrackHasNotFallenAndTheTextIsBesideThePole) {
  std::vector<double> observations;
  for (int i = 0; i <= 25; ++i) observations.insert(observations.end(), {0.1 * i, 5, 0, 0});
  content_.tasks[0].personal.episode = shared(episodeOf(0, Trajectory::PERSONAL, 4, observations));
  EXPECT_GT(find(scene_->moving(content_, start_), "steps", 0).pose.position.x, 0);
  start_[0] = 100;
  const Marker text = find(scene_->moving(content_, start_), "steps", 0);
  EXPECT_EQ("left the track at step 25", text.text);
  EXPECT_LT(text.pose.position.x, 0);
}

TEST_F(CartPoleSceneTest, TracesStayShort) {
  content_.tasks[0].meta.episode = shared(drive(0, Trajectory::META, 200));
  const std::size_t length = lengthOf(scene_->still(content_));
  content_.tasks[0].meta.episode = shared(drive(0, Trajectory::META, 20000));
  EXPECT_LE(lengthOf(scene_->still(content_)), length);
}

TEST_F(CartPoleSceneTest, NamesWhatCannotBeDrawn) {
  Trajectory message = drive(0, Trajectory::META, 3);
  EXPECT_EQ("", scene_->problem(message));
  message.observations.pop_back();
  EXPECT_NE(std::string::npos, scene_->problem(message).find("15 observations of size 4"));
  message = drive(0, Trajectory::META, 3);
  message.observations[5] = NAN;
  EXPECT_NE(std::string::npos, scene_->problem(message).find("not finite"));
  message = drive(0, 0, 3);
  EXPECT_NE(std::string::npos, scene_->problem(message).find("policy 0"));
  message = drive(0, Trajectory::META, 3);
  message.actions.clear();
  EXPECT_NE(std::string::npos, scene_->problem(message).find("0 actions for 3 steps"));
}

}  // namespace
}  // namespace pmeta_nodes
