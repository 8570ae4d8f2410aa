#include "view/trace_scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene_support.h"
#include "view/robot_scene.h"

namespace pmeta_nodes {
namespace {

using namespace test;

/// An environment of that many numbers, of which nothing is known but names.
class Plain : public pmeta::Env {
 public:
  explicit Plain(int observations) {
    std::vector<pmeta::Quantity> observation;
    for (int i = 0; i < observations; ++i) {
      observation.push_back({"sensor_" + std::to_string(i), "bar"});
    }
    spec_ =
        pmeta::describedSpec("plain", 20, observation, {{"valve", "", -1, 1}, {"fan", "", 0, 5}});
  }
  const pmeta::EnvSpec& spec() const override { return spec_; }
  void reset(pmeta::Rng&, double*) override {}
  pmeta::Step step(const double*, pmeta::Rng&, double*) override { return {}; }

 private:
  pmeta::EnvSpec spec_;
};

class PlainFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings& settings) override {
    settings.bind("environment.observations", observations_, "how many there are");
  }
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int task) const override { return "plain_" + std::to_string(task); }
  std::string taskDescription(int) const override { return "nothing to be seen"; }
  std::unique_ptr<pmeta::Env> create(int) const override {
    return std::make_unique<Plain>(observations_);
  }

 private:
  int observations_ = 3;
};

const pmeta::RegisteredFamily<PlainFamily> kPlain("plain");

pmeta::Experiment plain(int observations = 3) {
  return experiment("environment: {name: plain, observations: " + std::to_string(observations) +
                    "}\nlearner: sac");
}

/// Sensor k is k + step, the actions are 0, the reward is minus the step.
Trajectory rise(int task, int policy, int steps, int sensors = 3) {
  std::vector<double> observations;
  for (int i = 0; i <= steps; ++i) {
    for (int k = 0; k < sensors; ++k) observations.push_back(k + i);
  }
  Trajectory message = episodeOf(task, policy, static_cast<std::size_t>(sensors), observations);
  message.action_size = 2;
  message.actions.assign(2 * static_cast<std::size_t>(steps), 0);
  for (int i = 0; i < steps; ++i) message.rewards[i] = -i - 1;
  return message;
}

class TraceSceneTest : public ::testing::Test {
 protected:
  const pmeta::Experiment experiment_ = plain();
  const std::unique_ptr<Scene> scene_ = makeScene(experiment_);
  SceneContent content_ = contentOf(2);
  std::vector<double> start_ = {0, 0};
};

TEST_F(TraceSceneTest, AnEnvironmentWithoutRowOrModelIsDrawnAsTraces) {
  EXPECT_NE(nullptr, dynamic_cast<const TraceScene*>(scene_.get()));
  EXPECT_EQ(nullptr, scenes().find("plain"));
  EXPECT_DOUBLE_EQ(0.5, scene_->stepSeconds()) << "twenty steps in about twelve seconds";
}

TEST_F(TraceSceneTest, KeepsTheSameMarkersWhateverIsKnown) {
  const auto still = names(scene_->still(content_));
  const auto moving = names(scene_->moving(content_, start_));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
  content_.tasks[0].personal.episode = shared(rise(0, Trajectory::PERSONAL, 20));
  content_.tasks[1].meta.episode = shared(rise(1, Trajectory::META, 5));
  content_.tasks[1].personal.episode = shared(rise(1, Trajectory::PERSONAL, 0));
  EXPECT_EQ(still, names(scene_->still(content_)));
  EXPECT_EQ(moving, names(scene_->moving(content_, start_)));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
}

TEST_F(TraceSceneTest, NamesUnitsAndScalesStandBesideTheTraces) {
  content_.tasks[0].personal.episode = shared(rise(0, Trajectory::PERSONAL, 20));
  const MarkerArray markers = scene_->still(content_);
  const int of_task_1 = 6;  // three observations, two actions, the reward
  const auto told = [&](int trace) {
    return find(markers, "quantities", of_task_1 + trace).text + ": " +
           find(markers, "scales", of_task_1 + trace).text;
  };
  EXPECT_EQ("sensor_0 [bar]: 0 to 20", told(0));
  EXPECT_EQ("sensor_2 [bar]: 2 to 22", told(2));
  EXPECT_EQ("valve: -1 to 1", told(3));
  EXPECT_EQ("fan: 0 to 5", told(4));
  EXPECT_EQ("reward: -20 to -1", told(5));
  EXPECT_EQ("20 steps", find(markers, "axes", 0).text);
}

TEST_F(TraceSceneTest, DotsPlayTheEpisodeOnTheirTraces) {
  content_.tasks[0].meta.episode = shared(rise(0, Trajectory::META, 20));
  start_[0] = 4.5 * scene_->stepSeconds();
  const auto meanOf = [&](int disc) {
    const Marker dots = find(scene_->moving(content_, start_), "dots", 1);
    const std::size_t corners = dots.points.size() / 6;
    Point mean;
    for (std::size_t i = disc * corners; i < (disc + 1) * corners; ++i) {
      mean.x += dots.points[i].x / static_cast<double>(corners);
      mean.y += dots.points[i].y / static_cast<double>(corners);
    }
    return mean;
  };
  const Point early = meanOf(0);
  EXPECT_EQ("step 4", find(scene_->moving(content_, start_), "steps", 1).text);
  start_[0] = 12.5 * scene_->stepSeconds();
  EXPECT_GT(meanOf(0).x, early.x);
  EXPECT_GT(meanOf(0).y, early.y) << "sensors rise";
  EXPECT_LT(meanOf(0).x, kSceneWidth / 2);
}

TEST_F(TraceSceneTest, ManyNumbersAreCutToWhatCanBeReadAndTheLegendSaysSo) {
  const pmeta::Experiment many = plain(400);
  const auto scene = makeScene(many);
  content_.tasks[0].meta.episode = shared(rise(0, Trajectory::META, 20, 400));
  const MarkerArray markers = scene->still(content_);
  EXPECT_EQ("", complaint(*scene, markers));
  bool reward = false, told = false;
  for (const Marker& marker : markers.markers) {
    if (marker.ns == "quantities") {
      EXPECT_GT(marker.scale.z, 0.07) << marker.text;
      reward = reward || marker.text == "reward";
    }
    told = told || marker.text.find(" of 400 observations") != std::string::npos;
  }
  EXPECT_TRUE(reward);
  EXPECT_TRUE(told);
}

TEST_F(TraceSceneTest, StaysInsideItsCardsAndShort) {
  content_.tasks[0].meta.episode = shared(rise(0, Trajectory::META, 200));
  content_.tasks[1].personal.episode = shared(rise(1, Trajectory::PERSONAL, 200));
  const MarkerArray markers = scene_->still(content_);
  for (const int id : {1, 2}) {
    const Marker& traces = find(markers, "traces", id);
    ASSERT_FALSE(traces.points.empty());
    for (const auto& point : traces.points) {
      ASSERT_LT(std::abs(point.x), kSceneWidth / 2);
      ASSERT_LT(std::abs(point.y), kSceneHeight / 2);
    }
  }
  const std::size_t length = lengthOf(markers);
  content_.tasks[0].meta.episode = shared(rise(0, Trajectory::META, 50000));
  EXPECT_LE(lengthOf(scene_->still(content_)), length);
}

TEST_F(TraceSceneTest, NamesWhatCannotBeDrawn) {
  EXPECT_EQ("", scene_->problem(rise(0, Trajectory::META, 3)));
  EXPECT_NE(std::string::npos,
            scene_->problem(rise(0, Trajectory::META, 3, 4)).find("must be of size 3"));
  Trajectory message = rise(0, Trajectory::META, 3);
  message.action_size = 1;
  message.actions.resize(3);
  EXPECT_EQ("its actions are of size 1; they must be of size 2.", scene_->problem(message));
  message = rise(0, Trajectory::META, 3);
  message.rewards[1] = NAN;
  EXPECT_EQ("it holds an action or a reward that is not finite.", scene_->problem(message));
}

TEST_F(TraceSceneTest, NumbersThatNearlyOverflowAreDrawn) {
  Trajectory message = rise(0, Trajectory::META, 3);
  message.observations[0] = 1.7e308;
  message.observations[3] = -1.7e308;
  content_.tasks[0].meta.episode = shared(message);
  const MarkerArray markers = scene_->still(content_);
  for (const auto& point : find(markers, "traces", 1).points) {
    ASSERT_TRUE(std::isfinite(point.y));
  }
  for (const auto& point : find(markers, "plots", 0).points) ASSERT_TRUE(std::isfinite(point.y));
}

}  // namespace
}  // namespace pmeta_nodes
