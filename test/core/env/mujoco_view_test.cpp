#include "pmeta_core/env/mujoco_view.h"

#include <gtest/gtest.h>

#include <string>

#include "../support.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"

namespace pmeta {
namespace {

constexpr double kDegree = 3.141592653589793 / 180;

// a box on a joint, with a hinge about y on it, and with what else the world holds
MujocoModel model(const std::string& joint, const std::string& rest = "") {
  return MujocoModel::parse(
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body name='stand'/>"
      "<body name='torso' pos='0 0 1'>" +
          joint +
          "<geom type='box' size='0.1 0.1 0.1'/><body name='arm'>"
          "<joint type='hinge' axis='0 1 0'/><geom size='0.1' pos='1 0 0'/>"
          "</body></body>" +
          rest + "</worldbody></mujoco>",
      "view");
}

TEST(MujocoView, ShippedRobotsAreFollowedByTheirTorso) {
  const auto cheetah = MujocoModel::open("", HalfCheetah::layout());
  const auto walker = MujocoModel::open("", Walker2d::layout());
  const auto ant = MujocoModel::open("", Ant::layout());
  for (const auto& robot : {cheetah, walker, ant}) {
    EXPECT_EQ(viewOf(*robot).body, robot->body("torso")) << robot->source();
    EXPECT_NEAR(viewOf(*robot).width, 2.9, 0.6) << robot->source();
  }
  EXPECT_EQ(viewOf(*cheetah).elevation, 0);
  EXPECT_EQ(viewOf(*walker).elevation, 0);
  EXPECT_EQ(viewOf(*walker).depth, 0);
  EXPECT_NEAR(viewOf(*ant).elevation, 40 * kDegree, 1e-12);
  EXPECT_GT(viewOf(*ant).depth, 2);
}

TEST(MujocoView, WhatMovesInThePlaneIsSeenFromItsSide) {
  const MujocoModel slides = model("<joint type='slide' axis='1 0 0'/>");
  EXPECT_EQ(viewOf(slides).elevation, 0);
  EXPECT_EQ(viewOf(slides).body, slides.body("torso"));
  for (const char* joint : {"<freejoint/>", "<joint type='slide' axis='0 1 0'/>",
                            "<joint type='hinge' axis='0 0 1'/>", "<joint type='ball'/>"}) {
    EXPECT_NEAR(viewOf(model(joint)).elevation, 40 * kDegree, 1e-12) << joint;
  }
}

TEST(MujocoView, AnArmThatStandsIsNotFollowed) {
  EXPECT_EQ(viewOf(model("<joint type='hinge' axis='0 0 1'/>")).body, 0);
  EXPECT_EQ(viewOf(model("")).body, 0);
}

TEST(MujocoView, TheModelsCameraDecides) {
  const std::string follows =
      "<freejoint/><camera name='track' mode='trackcom' pos='0 -3 0' xyaxes='1 0 0 0 0 1'/>";
  const MujocoModel side = model(follows);
  EXPECT_EQ(viewOf(side).elevation, 0);
  EXPECT_EQ(viewOf(side).body, side.body("torso"));
  // looks down by 45 degrees, from a place of its own
  const MujocoModel above = model("<freejoint/>", "<camera pos='0 -3 4' xyaxes='1 0 0 0 1 1'/>");
  EXPECT_NEAR(viewOf(above).elevation, 45 * kDegree, 1e-6);
  EXPECT_EQ(viewOf(above).body, 0);
  // the eyes of a robot are none from where to look at it
  const MujocoModel eyes = model("<freejoint/><camera mode='fixed' xyaxes='0 -1 0 0 0 1'/>");
  EXPECT_NEAR(viewOf(eyes).elevation, 40 * kDegree, 1e-12);
  EXPECT_EQ(viewOf(eyes).body, eyes.body("torso"));
}

TEST(MujocoView, AModelWithoutGeomsIsRefused) {
  const MujocoModel empty = MujocoModel::parse(
      "<mujoco><worldbody><body><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>"
      "</worldbody></mujoco>",
      "empty");
  EXPECT_EQ(test::errorOf([&] { viewOf(empty); }), "the model empty has no geoms to be drawn.");
}

}  // namespace
}  // namespace pmeta
