#include "pmeta_core/env/mujoco_kinematics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"

namespace pmeta {
namespace {

using Type = GeomShape::Type;

constexpr char kArm[] = R"(
<mujoco>
  <compiler angle="radian"/>
  <asset><material name="red" rgba="1 0.25 0 1"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="torso" pos="0 0 2">
      <joint type="hinge" axis="0 1 0"/>
      <geom name="bar" type="capsule" size="0.1 0.5" pos="0 0 1" material="red"/>
      <geom type="box" size="0.1 0.2 0.3"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="cylinder" size="0.1 0.2"/>
      <geom type="sphere" size="0.4" rgba="0.5 0.5 1 1"/>
    </body>
  </worldbody>
</mujoco>)";

TEST(MujocoKinematics, KnowsTheShapesOfBodiesButNotOfTheWorld) {
  const MujocoKinematics arm(MujocoModel::parse(kArm, "arm"));
  ASSERT_EQ(arm.shapes().size(), 5u);
  EXPECT_EQ(arm.shapes()[0].type, Type::kCapsule);
  EXPECT_EQ(arm.shapes()[0].name, "bar");
  EXPECT_EQ(arm.shapes()[0].size[0], 0.1);
  EXPECT_EQ(arm.shapes()[0].size[1], 0.5);
  EXPECT_EQ(arm.shapes()[0].rgb, (std::array<double, 3>{1, 0.25, 0}));
  EXPECT_EQ(arm.shapes()[1].type, Type::kBox);
  EXPECT_EQ(arm.shapes()[2].type, Type::kEllipsoid);
  EXPECT_EQ(arm.shapes()[3].type, Type::kCylinder);
  EXPECT_EQ(arm.shapes()[4].type, Type::kSphere);
  EXPECT_EQ(arm.shapes()[4].rgb, (std::array<double, 3>{0.5, 0.5, 1}));
}

TEST(MujocoKinematics, TurnsAnArmInAPlane) {
  MujocoKinematics arm(MujocoModel::parse(kArm, "arm"));
  EXPECT_EQ(arm.restConfiguration(), std::vector<double>{0});
  for (const double angle : {0.0, 0.7, -2.0}) {
    arm.pose(&angle);
    // a positive turn about y takes z towards x
    EXPECT_NEAR(arm.position(0)[0], std::sin(angle), 1e-15);
    EXPECT_NEAR(arm.position(0)[1], 0, 1e-15);
    EXPECT_NEAR(arm.position(0)[2], 2 + std::cos(angle), 1e-15);
    const double* axes = arm.rotation(0);
    EXPECT_NEAR(axes[2], std::sin(angle), 1e-15) << "the capsule's axis";
    EXPECT_NEAR(axes[5], 0, 1e-15);
    EXPECT_NEAR(axes[8], std::cos(angle), 1e-15);
    EXPECT_EQ(arm.bodyPosition(1)[2], 2);
  }
}

TEST(MujocoKinematics, CheetahAtRestIsAsItsModelSays) {
  MujocoKinematics cheetah(*MujocoModel::open("", HalfCheetah::layout()));
  ASSERT_EQ(cheetah.nq(), 9);
  cheetah.pose(cheetah.restConfiguration().data());
  ASSERT_EQ(cheetah.shapes().size(), 8u);
  // torso from (-0.5, 0) to (0.5, 0) at height 0.7, and the head in front of it
  EXPECT_NEAR(cheetah.position(0)[0], 0, 1e-12);
  EXPECT_NEAR(cheetah.position(0)[2], 0.7, 1e-12);
  EXPECT_NEAR(std::abs(cheetah.rotation(0)[2]), 1, 1e-12) << "it lies along x";
  EXPECT_NEAR(cheetah.shapes()[0].size[1], 0.5, 1e-12);
  EXPECT_NEAR(cheetah.position(1)[0], 0.6, 1e-12);
  EXPECT_NEAR(cheetah.position(1)[2], 0.8, 1e-12);
  EXPECT_NEAR(cheetah.rotation(1)[2], std::sin(0.87), 1e-12);
  EXPECT_NEAR(cheetah.position(2)[0], -0.5 + 0.1, 1e-12);
  EXPECT_NEAR(cheetah.position(2)[2], 0.7 - 0.13, 1e-12);
}

TEST(MujocoKinematics, NormalisesQuaternions) {
  MujocoKinematics ant(*MujocoModel::open("", Ant::layout()));
  std::vector<double> qpos = ant.restConfiguration();
  ant.pose(qpos.data());
  const std::vector<double> once(ant.position(3), ant.position(3) + 3);
  for (int i = 3; i < 7; ++i) qpos[i] *= 2;
  ant.pose(qpos.data());
  EXPECT_EQ(once, std::vector<double>(ant.position(3), ant.position(3) + 3));
}

constexpr char kMeshes[] = R"(
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 2 0  0 0 4"/></asset>
  <worldbody>
    <body name="wall"><geom type="plane" size="1 1 1"/></body>
    <body name="covered">
      <joint type="hinge" axis="0 1 0"/>
      <geom type="mesh" mesh="wedge" contype="0" conaffinity="0"/>
      <geom type="capsule" size="0.1 0.5"/>
    </body>
    <body name="bare" pos="0 0 3">
      <joint type="hinge" axis="0 1 0"/>
      <geom name="shell" type="mesh" mesh="wedge"/>
    </body>
  </worldbody>
</mujoco>)";

TEST(MujocoKinematics, AMeshIsABoxWhereNothingElseStandsForIt) {
  const MujocoKinematics robot(MujocoModel::parse(kMeshes, "meshes"));
  ASSERT_EQ(robot.shapes().size(), 2u);
  EXPECT_EQ(robot.shapes()[0].type, Type::kCapsule);
  EXPECT_EQ(robot.shapes()[1].type, Type::kBox);
  EXPECT_EQ(robot.shapes()[1].name, "shell");
  // the mesh is turned into its axes of inertia: its volume stays near that of the box around it
  const auto& half = robot.shapes()[1].size;
  EXPECT_GT(8 * half[0] * half[1] * half[2], 8.0 / 6);
  EXPECT_LT(8 * half[0] * half[1] * half[2], 3 * 8.0);
}

}  // namespace
}  // namespace pmeta
