#include "view/robot_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/mujoco_env.h"
#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

pmeta::Experiment robots(const std::string& environment) {
  return experiment("environment: {name: " + environment +
                    "}\nlearner: sac\nsac: {task_encoding: inference}");
}

/// An episode of these configurations; what is observed does not matter.
Trajectory episodeOfPositions(int task, int policy, const std::vector<std::vector<double>>& qpos) {
  Trajectory message = episodeOf(task, policy, 1, std::vector<double>(qpos.size(), 0.0));
  message.position_size = static_cast<std::uint32_t>(qpos.front().size());
  for (const auto& q : qpos) message.positions.insert(message.positions.end(), q.begin(), q.end());
  return message;
}

/// A cheetah at rest that slides along x by `speed` m a step.
Trajectory slide(int task, int policy, int steps, double speed) {
  std::vector<std::vector<double>> qpos(steps + 1, std::vector<double>(9, 0.0));
  for (int i = 0; i <= steps; ++i) qpos[i][0] = speed * i;
  return episodeOfPositions(task, policy, qpos);
}

class CheetahSceneTest : public ::testing::Test {
 protected:
  const pmeta::Experiment experiment_ = robots("half_cheetah_dir");
  const std::unique_ptr<Scene> scene_ = makeScene(experiment_);
  SceneContent content_ = contentOf(4);  // two for training, two for test
  std::vector<double> start_ = std::vector<double>(4, 0.0);
  double scale() const { return dynamic_cast<const RobotScene&>(*scene_).scale(); }

  void expectPoint(const geometry_msgs::Point& point, double x, double z) const {
    EXPECT_NEAR(x * scale(), point.x, 1e-12);
    EXPECT_NEAR(0, point.y, 1e-12);
    EXPECT_NEAR(z * scale(), point.z, 1e-12);
  }
};

TEST_F(CheetahSceneTest, KeepsTheSameMarkersWhateverIsKnown) {
  const auto still = names(scene_->still(content_));
  const auto moving = names(scene_->moving(content_, start_));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
  content_.tasks[0].personal.episode = shared(slide(0, Trajectory::PERSONAL, 20, 0.1));
  content_.tasks[3].meta.episode = shared(slide(3, Trajectory::META, 20, -0.1));
  start_ = {0.5, 0.5, 0.5, 0.5};
  EXPECT_EQ(still, names(scene_->still(content_)));
  EXPECT_EQ(moving, names(scene_->moving(content_, start_)));
  EXPECT_EQ("", complaint(*scene_, scene_->still(content_)));
  EXPECT_EQ("", complaint(*scene_, scene_->moving(content_, start_)));
}

TEST_F(CheetahSceneTest, PosesTheModelsGeoms) {
  content_.tasks[0].meta.episode = shared(slide(0, Trajectory::META, 3, 0.1));
  start_[0] = 2 * scene_->stepSeconds();
  const MarkerArray markers = scene_->moving(content_, start_);
  const int first = 8;  // meta's: a cheetah has eight geoms
  const Marker& torso = find(markers, "geoms", first);
  EXPECT_EQ("task_0/meta/robot", torso.header.frame_id);
  EXPECT_EQ(Marker::CYLINDER, torso.type);
  expectPoint(torso.pose.position, 0, 0.7);
  EXPECT_NEAR(2 * 0.5 * scale(), torso.scale.z, 1e-12);
  EXPECT_NEAR(2 * 0.046 * scale(), torso.scale.x, 1e-12);
  // the cylinder's z axis, as the quaternion turns it, lies along x
  const auto& q = torso.pose.orientation;
  EXPECT_NEAR(1, std::abs(2 * (q.x * q.z + q.w * q.y)), 1e-9);

  // ends of all capsules, in the order of the model
  const Marker& caps = find(markers, "caps", first);
  ASSERT_EQ(16u, caps.points.size());
  const double low = std::min(caps.points[0].x, caps.points[1].x);
  EXPECT_NEAR(-0.5 * scale(), low, 1e-12);
  EXPECT_NEAR(0.5 * scale(), caps.points[0].x + caps.points[1].x - low, 1e-12);
  expectPoint(caps.points[2], 0.6 - 0.15 * std::sin(0.87), 0.8 - 0.15 * std::cos(0.87));
  expectPoint(caps.points[3], 0.6 + 0.15 * std::sin(0.87), 0.8 + 0.15 * std::cos(0.87));
}

TEST_F(CheetahSceneTest, PosesAreThoseOfMujoco) {
  std::vector<double> qpos = {3, 0.1, 0.4, 0.5, -0.3, 0.2, -0.6, 0.1, 0.3};
  content_.tasks[1].personal.episode = shared(episodeOfPositions(1, Trajectory::PERSONAL, {qpos}));
  pmeta::MujocoKinematics cheetah(*pmeta::MujocoModel::open("", pmeta::HalfCheetah::layout()));
  cheetah.pose(qpos.data());
  const MarkerArray markers = scene_->moving(content_, start_);
  for (int geom = 0; geom < 8; ++geom) {
    const Marker& marker = find(markers, "geoms", 2 * 8 + geom);
    const double* at = cheetah.position(geom);
    expectPoint(marker.pose.position, at[0] - 3, at[2]);
    const double* m = cheetah.rotation(geom);
    const auto& q = marker.pose.orientation;
    EXPECT_NEAR(m[2], 2 * (q.x * q.z + q.w * q.y), 1e-9);
    EXPECT_NEAR(m[8], 1 - 2 * (q.x * q.x + q.y * q.y), 1e-9);
    EXPECT_NEAR(m[0], 1 - 2 * (q.y * q.y + q.z * q.z), 1e-9);
  }
}

TEST_F(CheetahSceneTest, TheFloorPassesByAndThePathStaysInView) {
  content_.tasks[0].personal.episode = shared(slide(0, Trajectory::PERSONAL, 2000, 0.25));
  const auto ticks = [&](double seconds) {
    start_[0] = seconds;
    std::vector<double> xs;
    for (const auto& point : find(scene_->moving(content_, start_), "floors", 0).points) {
      xs.push_back(point.x);
    }
    return xs;
  };
  const double step = scene_->stepSeconds();
  EXPECT_EQ(ticks(0), ticks(4 * step)) << "a metre further the ticks are where they were";
  EXPECT_NE(ticks(0), ticks(2 * step));

  start_[0] = 2000 * step;
  const MarkerArray markers = scene_->moving(content_, start_);
  for (const auto& point : find(markers, "paths", 0).points) {
    EXPECT_LT(std::abs(point.x), kSceneWidth / 2);
  }
  EXPECT_NE(std::string::npos, find(markers, "steps", 0).text.find("x 500.00 m"));
  const std::size_t length = lengthOf(markers);
  content_.tasks[0].personal.episode = shared(slide(0, Trajectory::PERSONAL, 8000, 0.25));
  EXPECT_LE(lengthOf(scene_->moving(content_, start_)), length);
}

TEST_F(CheetahSceneTest, SaysWhereToGoAndHowFastItIs) {
  content_.tasks[0].meta.episode = shared(slide(0, Trajectory::META, 10, -0.1));
  start_[0] = 5 * scene_->stepSeconds();
  // task 0 is to run backward: -0.1 m in 0.05 s are 2 m/s towards its target
  EXPECT_EQ("x -0.50 m, 2.00 m/s", find(scene_->moving(content_, start_), "steps", 1).text);
  const MarkerArray still = scene_->still(content_);
  EXPECT_LT(find(still, "targets", 1).points.front().x, 0);
  EXPECT_GT(find(still, "targets", 3).points.front().x, 0);
}

TEST_F(CheetahSceneTest, TestTasksHaveOnlyTheMetaPolicy) {
  const auto moving = names(scene_->moving(content_, start_));
  EXPECT_EQ(0u, moving.count({"floors", 2 * 2}));
  EXPECT_EQ(1u, moving.count({"floors", 2 * 2 + 1}));
  EXPECT_THROW(shiftOf(*scene_, "task_2/personal"), std::out_of_range);
  EXPECT_NO_THROW(shiftOf(*scene_, "task_2/meta/robot"));
}

TEST_F(CheetahSceneTest, NamesWhatCannotBeDrawn) {
  Trajectory message = slide(0, Trajectory::META, 3, 0.1);
  EXPECT_EQ("", scene_->problem(message));
  message.positions.pop_back();
  EXPECT_NE(std::string::npos, scene_->problem(message).find("35 positions of size 9"));
  message.positions.clear();
  message.position_size = 0;
  EXPECT_NE(std::string::npos, scene_->problem(message).find("0 positions"));
  message = slide(0, Trajectory::META, 3, 0.1);
  message.positions[4] = INFINITY;
  EXPECT_NE(std::string::npos, scene_->problem(message).find("not finite"));
  message = slide(0, Trajectory::META, 3, 1e17);
  EXPECT_EQ("it holds a position beyond 1e+10, which no simulation reaches.",
            scene_->problem(message));
  EXPECT_EQ("it has 100001 steps; at most 100000 are shown.",
            scene_->problem(slide(0, Trajectory::META, 100001, 0)));
}

TEST(RobotScene, FarFromTheOriginThereAreAsManyMetresInView) {
  for (const char* environment : {"half_cheetah_dir", "ant_fwd_back"}) {
    const pmeta::Experiment two = robots(environment);
    const auto scene = makeScene(two);
    const std::size_t nq = environment == std::string("half_cheetah_dir") ? 9 : 15;
    const std::vector<double> start(two.totalTasks(), 0.0);
    const auto pointsAt = [&](double x) {
      SceneContent content = contentOf(two.totalTasks());
      std::vector<double> qpos(nq, 0.0);
      qpos[0] = x;
      content.tasks[0].personal.episode =
          shared(episodeOfPositions(0, Trajectory::PERSONAL, {qpos, qpos}));
      return find(scene->moving(content, start), "floors", 0).points.size();
    };
    EXPECT_EQ(pointsAt(0), pointsAt(1e10)) << environment;
  }
}

TEST(RobotScene, CheetahsWithATargetVelocitySayIt) {
  const pmeta::Experiment two =
      experiment("environment: {name: half_cheetah_vel, velocities: [1.5, 0.5]}\nlearner: sac");
  const auto scene = makeScene(two);
  SceneContent content = contentOf(two.totalTasks());
  content.tasks[1].personal.episode = shared(slide(1, Trajectory::PERSONAL, 4, 0.05));
  const std::vector<double> late(two.totalTasks(), 100.0);
  EXPECT_EQ("1.00 m/s, target 0.50", find(scene->moving(content, late), "steps", 2).text);
}

TEST(RobotScene, AntsAreSeenFromAboveWithTheirTargetOnTheFloor) {
  const pmeta::Experiment ants = robots("ant_fwd_back");
  const auto scene = makeScene(ants);
  SceneContent content = contentOf(ants.totalTasks());
  std::vector<double> qpos(15, 0.0);
  qpos[0] = 7;
  qpos[1] = -4;
  qpos[2] = 0.5;
  qpos[3] = 1;
  content.tasks[1].meta.episode = shared(episodeOfPositions(1, Trajectory::META, {qpos}));
  const MarkerArray markers = scene->moving(content, std::vector<double>(4, 0.0));
  EXPECT_EQ("", complaint(*scene, markers));
  const double scale = dynamic_cast<const RobotScene&>(*scene).scale();
  const int first = 3 * 13;  // an ant has 13 geoms
  const Marker& torso = find(markers, "geoms", first);
  EXPECT_EQ(Marker::SPHERE, torso.type);
  EXPECT_NEAR(0, torso.pose.position.x, 1e-12);
  EXPECT_NEAR(0, torso.pose.position.y, 1e-12);
  EXPECT_NEAR(0.5 * scale, torso.pose.position.z, 1e-12);
  EXPECT_NEAR(0.5 * scale, torso.scale.x, 1e-12);
  EXPECT_EQ(24u, find(markers, "caps", first + 1).points.size());
  EXPECT_EQ("task_1/meta/robot", find(markers, "floors", 3).header.frame_id);
  // forward is +x, backward -x
  EXPECT_GT(find(scene->still(content), "targets", 1).points.front().x, 0);
  EXPECT_LT(find(scene->still(content), "targets", 3).points.front().x, 0);
}

TEST(RobotScene, WalkersHaveCapsOfEachRadius) {
  const pmeta::Experiment walkers = robots("walker_2d_params");
  const auto scene = makeScene(walkers);
  SceneContent content = contentOf(walkers.totalTasks());
  std::vector<double> qpos(9, 0.0);
  qpos[1] = 1.25;
  Trajectory message = episodeOfPositions(0, Trajectory::PERSONAL, {qpos, qpos});
  message.terminated = true;
  content.tasks[0].personal.episode = shared(message);
  const MarkerArray markers =
      scene->moving(content, std::vector<double>(walkers.totalTasks(), 100.0));
  EXPECT_EQ("", complaint(*scene, markers));
  // torso and thighs, legs, feet
  EXPECT_EQ(6u, find(markers, "caps", 0).points.size());
  EXPECT_EQ(4u, find(markers, "caps", 2).points.size());
  EXPECT_EQ(4u, find(markers, "caps", 3).points.size());
  const double scale = dynamic_cast<const RobotScene&>(*scene).scale();
  EXPECT_NEAR(1.25 * scale, find(markers, "geoms", 0).pose.position.z, 1e-12);
  EXPECT_NE(std::string::npos, find(markers, "steps", 0).text.find("fell at step 1"));
}

/// A cart of the size of a hand, which no scene knows.
class Cart : public pmeta::MujocoEnv {
 public:
  Cart() : MujocoEnv("cart", layout(), {{"x", "m"}}, 20, cart(), 1) {}

 private:
  static pmeta::MujocoLayout layout() { return {"cart", 1, 1, {"torso"}, {"rail"}, {"motor"}}; }
  static std::shared_ptr<const pmeta::MujocoModel> cart() {
    return std::make_shared<pmeta::MujocoModel>(pmeta::MujocoModel::parse(
        "<mujoco><worldbody><body name='torso' pos='0 0 0.02'><joint name='rail' type='slide' "
        "axis='1 0 0'/><geom type='box' size='0.05 0.03 0.02'/></body></worldbody><actuator>"
        "<motor name='motor' joint='rail' ctrllimited='true' ctrlrange='-1 "
        "1'/></actuator></mujoco>",
        "cart"));
  }
  void drawStart(pmeta::Rng&, double*, double*) override {}
  void beforeStep() override {}
  pmeta::Step afterStep() override { return {}; }
  void observe(double* observation) const override { *observation = simulation_.qpos()[0]; }
};

class CartFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 1; }
  std::string taskName(int) const override { return "cart_0"; }
  std::string taskDescription(int) const override { return "a cart"; }
  std::unique_ptr<pmeta::Env> create(int) const override { return std::make_unique<Cart>(); }
};

const pmeta::RegisteredFamily<CartFamily> kCart("cart");

TEST(RobotScene, AModelWithoutARowIsDrawnFromItsGeomsAndGoesNowhere) {
  const pmeta::Experiment carts = experiment("environment: {name: cart}\nlearner: sac");
  const auto scene = makeScene(carts);
  const auto* robots = dynamic_cast<const RobotScene*>(scene.get());
  ASSERT_NE(nullptr, robots);
  SceneContent content = contentOf(1);
  content.tasks[0].meta.episode =
      shared(episodeOfPositions(0, Trajectory::META, {{0.0}, {0.1}, {0.2}}));
  EXPECT_DOUBLE_EQ(0.002, scene->stepSeconds());
  const MarkerArray still = scene->still(content);
  const MarkerArray moving = scene->moving(content, {1.0});
  EXPECT_EQ("", complaint(*scene, still));
  EXPECT_EQ("", complaint(*scene, moving));
  EXPECT_NEAR(2 * 0.05 * robots->scale(), find(moving, "geoms", 1).scale.x, 1e-9);
  EXPECT_GT(find(moving, "geoms", 1).scale.x, 0.5) << "as large as others";
  EXPECT_EQ("x 0.20 m, 50.00 m/s", find(moving, "steps", 1).text);
  EXPECT_THROW(find(still, "targets", 1), std::out_of_range);
  bool spaced = false;
  for (const Marker& marker : still.markers) {
    EXPECT_EQ(std::string::npos, marker.text.find("to go"));
    spaced = spaced || marker.text == "every 0.1 m";
  }
  EXPECT_TRUE(spaced);
}

TEST(RobotScene, EachTaskIsDrawnFromItsOwnModel) {
  const std::string model = ::testing::TempDir() + "/robot_scene_rod.xml";
  std::ofstream(model)
      << "<mujoco><worldbody><body name='rod'><joint name='hinge' axis='0 1 0'/><geom "
         "type='capsule' fromto='0 0 0 0 0 0.2' size='0.02'/></body></worldbody><actuator><motor "
         "name='motor' joint='hinge' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  const pmeta::Experiment rods = experiment(
      "learner: sac\nenvironment:\n  name: mjcf\n  model_file: " + model +
      "\n  observations: {joint_positions: {}}\n  rewards: {alive: {}}\n  variations:\n    length: "
      "{term: link_length, bodies: [rod], values: [1, 2]}\n");
  const auto scene = makeScene(rods);
  SceneContent content = contentOf(2);
  for (int task = 0; task < 2; ++task) {
    content.tasks[task].meta.episode =
        shared(episodeOfPositions(task, Trajectory::META, {{0.0}, {0.1}}));
  }
  const MarkerArray moving = scene->moving(content, {0.0, 0.0});
  EXPECT_EQ("", complaint(*scene, moving));
  EXPECT_NEAR(2 * find(moving, "geoms", 1).scale.z, find(moving, "geoms", 3).scale.z, 1e-9);
}

}  // namespace
}  // namespace pmeta_nodes
