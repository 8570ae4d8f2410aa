#include "pmeta_core/env/mujoco_model.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "../support.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::TempDir;
using test::writeFile;

std::string cheetah() { return shippedModel("half_cheetah"); }

// the shipped half-cheetah with all occurrences of one text replaced by another
std::string cheetahWith(const std::string& from, const std::string& to) {
  std::string text = cheetah();
  EXPECT_NE(text.find(from), std::string::npos) << from;
  for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::string refused(const std::string& xml) {
  return errorOf([&] { MujocoModel::parse(xml, "mine.xml").require(HalfCheetah::layout()); });
}

TEST(MujocoModel, ShipsOneForEachEnvironment) {
  for (const MujocoLayout& layout : {HalfCheetah::layout(), Ant::layout(), Walker2d::layout()}) {
    ASSERT_NE(shippedModel(layout.model), nullptr);
    EXPECT_EQ(errorOf([&] { MujocoModel::open("", layout); }), "(no error)");
  }
  EXPECT_EQ(shippedModel("dog"), nullptr);
  EXPECT_EQ(errorOf([] {
              MujocoModel::open("", {"dog", 1, 1, {}, {}, {}});
            }),
            "no model 'dog' is shipped: give environment.model_file.");
}

TEST(MujocoModel, MalformedFilesAreRefusedInMujocosWords) {
  const std::string cut = cheetah().substr(0, 500);
  const std::string error = refused(cut);
  EXPECT_EQ(error.find("MuJoCo refuses the model mine.xml: XML parse error"), 0u) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos);
  const std::string attribute = refused(cheetahWith("gear=\"90\"", "gears=\"90\""));
  EXPECT_NE(attribute.find("unrecognized attribute: 'gears'"), std::string::npos) << attribute;
  EXPECT_NE(attribute.find("line"), std::string::npos) << attribute;
  const std::string joint = refused(cheetahWith("joint=\"bshin\"", "joint=\"shin\""));
  EXPECT_NE(joint.find("unknown transmission target 'shin'"), std::string::npos) << joint;
  EXPECT_EQ(refused(""), "the model mine.xml is empty.");
}

TEST(MujocoModel, WhatIsMissingIsNamed) {
  const std::string advice = ": see config/models/half_cheetah.xml.";
  EXPECT_EQ(refused(cheetahWith("<motor name=\"bfoot\" joint=\"bfoot\" gear=\"60\"/>", "")),
            "the model mine.xml has no motor 'bfoot'" + advice);
  EXPECT_EQ(refused(cheetahWith("<joint name=\"root_pitch\" class=\"root\" type=\"hinge\" axis=\"0 "
                                "1 0\"/>",
                                "")),
            "the model mine.xml has no joint 'root_pitch'" + advice);
  EXPECT_EQ(refused(cheetahWith("<body name=\"torso\"", "<body name=\"trunk\"")),
            "the model mine.xml has no body 'torso'" + advice);
}

TEST(MujocoModel, WhatIsElseIsNamed) {
  const std::string order = refused(cheetahWith(
      "<motor name=\"bthigh\" joint=\"bthigh\" gear=\"120\"/>\n    <motor name=\"bshin\" "
      "joint=\"bshin\" gear=\"90\"/>",
      "<motor name=\"bshin\" joint=\"bshin\" gear=\"90\"/>\n    <motor name=\"bthigh\" "
      "joint=\"bthigh\" gear=\"120\"/>"));
  EXPECT_EQ(order,
            "the model mine.xml has the motors bshin, bthigh, bfoot, fthigh, fshin, ffoot but must "
            "have bthigh, bshin, bfoot, fthigh, fshin, ffoot, in this order: see "
            "config/models/half_cheetah.xml.");
  EXPECT_NE(refused(cheetahWith("</actuator>", "<motor name=\"tail\" joint=\"bfoot\"/></actuator>"))
                .find("has the motors bthigh, bshin, bfoot, fthigh, fshin, ffoot, tail but must"),
            std::string::npos);
  EXPECT_EQ(refused(cheetahWith("<joint name=\"ffoot\" range=\"-0.5 0.5\"",
                                "<joint name=\"ffoot\" type=\"ball\" range=\"0 0.5\"")),
            "the model mine.xml has nq = 12 but must have 9: see config/models/half_cheetah.xml.");
  EXPECT_EQ(refused(cheetahWith("ctrlrange=\"-1 1\"", "ctrlrange=\"-2 2\"")),
            "the motor 'bthigh' of the model mine.xml must be limited to controls from -1 to 1: "
            "scale its gear instead: see config/models/half_cheetah.xml.");
  EXPECT_EQ(refused(cheetahWith("<motor name=\"ffoot\" joint=\"ffoot\" gear=\"30\"/>",
                                "<general name=\"ffoot\" joint=\"ffoot\" dyntype=\"filter\" "
                                "ctrllimited=\"true\" ctrlrange=\"-1 1\"/>")),
            "the model mine.xml has na = 1 but must have 0: see config/models/half_cheetah.xml.");
}

TEST(MujocoModel, FilesOfOnesOwnAreTaken) {
  const TempDir dir;
  writeFile(dir / "light.xml", cheetahWith("settotalmass=\"14\"", "settotalmass=\"7\""));
  HalfCheetahDirFamily family;
  Settings settings;
  family.bind(settings);
  settings.assign("model_file:=" + (dir / "light.xml"));
  family.build(0);
  const auto light = family.make(1);
  HalfCheetahDirFamily shipped;
  shipped.build(0);
  const auto heavy = shipped.make(1);
  double one[20], other[20];
  Rng rng(1, 0, Stream::kMeasure), same = rng;
  light->reset(rng, one);
  heavy->reset(same, other);
  const double action[6] = {1, 1, 1, 1, 1, 1};
  EXPECT_NE(light->step(action, rng, one).reward, heavy->step(action, rng, other).reward);

  EXPECT_NE(errorOf([&] { MujocoModel::load(dir / "none.xml"); }).find(dir / "none.xml"),
            std::string::npos);
}

TEST(MujocoModel, IsSharedByTheEnvironmentsOfAFamily) {
  AntFwdBackFamily family;
  family.build(0);
  const auto one = family.make(0), other = family.make(1);
  EXPECT_EQ(dynamic_cast<Ant&>(*one).simulation().model().get(),
            dynamic_cast<Ant&>(*other).simulation().model().get());
  Walker2dParamsFamily walkers;
  walkers.build(0);
  const auto first = walkers.make(0), again = walkers.make(0), second = walkers.make(1);
  const auto modelOf = [](Env& env) {
    return dynamic_cast<Walker2d&>(env).simulation().model().get();
  };
  EXPECT_EQ(modelOf(*first), modelOf(*again));
  EXPECT_NE(modelOf(*first), modelOf(*second));
}

TEST(MujocoSimulation, ABadStateNamesEnvironmentStepAndQuantity) {
  const auto model = MujocoModel::open("", HalfCheetah::layout());
  MujocoSimulation simulation(model, "half_cheetah_dir", 5);
  const double still[6] = {};
  const auto stepFrom = [&](double* values, int index, double value) {
    simulation.clear();
    simulation.forward();
    values[index] = value;
    return errorOf([&] { simulation.step(still, 12); });
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(stepFrom(simulation.qpos(), 4, kNan),
            "half_cheetah_dir, step 12: qpos[4] (bshin) is not finite or beyond 1e10; the episode "
            "cannot go on, reset it.");
  EXPECT_EQ(stepFrom(simulation.qvel(), 0, 1e11),
            "half_cheetah_dir, step 12: qvel[0] (root_x) is not finite or beyond 1e10; the episode "
            "cannot go on, reset it.");
  EXPECT_EQ(stepFrom(simulation.qvel(), 0, 1), "(no error)");
  const double broken[6] = {0, 0, kNan, 0, 0, 0};
  EXPECT_EQ(errorOf([&] { simulation.step(broken, 13); }),
            "half_cheetah_dir, step 13: action[2] (bfoot) is not finite; the episode cannot go on, "
            "reset it.");
}

// MuJoCo's own handlers would end the process, or write MUJOCO_LOG.TXT
TEST(MujocoSimulation, ErrorsWithinMujocoReachTheUser) {
  const std::string tiny = cheetahWith("<worldbody>", "<size nstack=\"10\"/><worldbody>");
  const std::string error = errorOf([&] {
    auto model = std::make_shared<const MujocoModel>(MujocoModel::parse(tiny, "tiny.xml"));
    MujocoSimulation simulation(model, "half_cheetah_dir", 5);
    simulation.forward();
  });
  EXPECT_NE(error.find("MuJoCo"), std::string::npos) << error;
  EXPECT_NE(error.find("tack"), std::string::npos) << error;

  const std::string few = cheetahWith("<worldbody>", "<size nconmax=\"1\"/><worldbody>");
  const auto model = std::make_shared<const MujocoModel>(MujocoModel::parse(few, "few.xml"));
  MujocoSimulation simulation(model, "half_cheetah_dir", 5);
  const double still[6] = {};
  const std::string full = errorOf([&] {
    for (int i = 1; i <= 100; ++i) simulation.step(still, i);
  });
  EXPECT_EQ(full.find("half_cheetah_dir, step "), 0u) << full;
  EXPECT_NE(full.find("MuJoCo says: "), std::string::npos) << full;
  EXPECT_FALSE(std::filesystem::exists("MUJOCO_LOG.TXT"));
}

}  // namespace
}  // namespace pmeta
