#include "pmeta_core/mjcf/mjcf_family.h"

#include <gtest/gtest.h>

#include <mujoco/mujoco.h>

#include <cmath>

#include "small_robot.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::smallRobot;
using test::TempDir;
using test::writeFile;

// what is wrong with a robot of the small model and these terms
std::string refusal(const std::string& terms) {
  const TempDir dir;
  std::string sentence = errorOf([&] { smallRobot(dir, terms); });
  const auto at = sentence.find(dir.path() + "/");
  if (at != std::string::npos) sentence.erase(at, dir.path().size() + 1);
  return sentence;
}

constexpr char kSeen[] = "  observations: {joint_positions: {}}\n";
constexpr char kAlive[] = "  rewards: {alive: {}}\n";
constexpr char kActed[] = "  actions: {control: {actuators: [shoulder]}}\n";

TEST(MjcfFamily, UnknownNamesAreRefusedWithThoseThatThereAreNearestFirst) {
  const std::string rest = std::string(kActed) + kAlive;
  EXPECT_EQ(refusal("  observations: {joint_positions: {joints: [sholder]}}\n" + rest),
            "environment.observations.joint_positions.joints is 'sholder' but the model small.xml "
            "has no joint of that name: did you mean 'shoulder'? It has shoulder, root, elbow.");
  EXPECT_EQ(refusal("  observations: {p: {term: body_position, body: hand}}\n" + rest),
            "environment.observations.p.body is 'hand' but the model small.xml has no body of that "
            "name. It has base, world, upper, lower, target.");
  EXPECT_EQ(
      refusal("  observations: {p: {term: body_position}}\n" + rest),
      "environment.observations.p.body names no body but the model small.xml has base, world, "
      "upper, lower, target.");
  EXPECT_EQ(refusal("  observations: {p: {term: site_position, site: tp}}\n" + rest),
            "environment.observations.p.site is 'tp' but the model small.xml has no site of that "
            "name: did you mean 'tip'? It has tip, elbow.");
  EXPECT_EQ(
      refusal("  observations: {sensor: {sensor: turn}}\n" + rest),
      "environment.observations.sensor.sensor is 'turn' but the model small.xml has no sensor "
      "of that name. It has turning, push.");
  EXPECT_EQ(refusal("  actions: {control: {actuators: [elbo]}}\n" + std::string(kSeen) + kAlive),
            "environment.actions.control.actuators is 'elbo' but the model small.xml has no "
            "actuator of that name: did you mean 'elbow'? It has elbow, shoulder.");
  EXPECT_EQ(refusal("  observations: {p: {term: goal_position, goal: reach}}\n" + rest),
            "environment.observations.p.goal is 'reach' but there are no goals: write one below "
            "environment.goals.");
  EXPECT_EQ(refusal("  observations: {joint_positions: {joints: [root.yaw]}}\n" + rest),
            "environment.observations.joint_positions.joints holds 'root.yaw' but that joint's "
            "numbers are root.x, root.y, root.z, root.qw, root.qx, root.qy, root.qz.");
  EXPECT_EQ(
      refusal(std::string(kSeen) + kActed + "  rewards: {joint_velocity: {joint: root}}\n"),
      "environment.rewards.joint_velocity.joint is 'root', which has several numbers: name one "
      "of root.x, root.y, root.z, root.qw, root.qx, root.qy, root.qz.");
}

TEST(MjcfFamily, UnknownTermsAndSettingsAreRefused) {
  const std::string rest = std::string(kActed) + kAlive;
  EXPECT_EQ(refusal("  observations: {p: {term: joint_position}}\n" + rest),
            "environment.observations.p.term is 'joint_position' but must be one of " +
                join(nearestFirst("joint_position", termsOf<ObservationTerm>().names())) +
                ": did you mean 'joint_positions'?");
  EXPECT_EQ(
      refusal("  observations: {angles: {}}\n" + rest)
          .rfind(
              "environment.observations.angles has no term, and 'angles' is none: write term: as "
              "one of ",
              0),
      0u);
  EXPECT_EQ(refusal("  observations: {joint_positions: {joint: [elbow]}}\n" + rest),
            "unknown setting 'environment.observations.joint_positions.joint' (small.yaml line 7): "
            "did you mean 'environment.observations.joint_positions.joints'?");
  EXPECT_EQ(refusal("  observations: [joint_positions]\n" + rest),
            "environment.observations must hold terms by name, each with its settings below it.");
  EXPECT_EQ(refusal("  observations: {'a b': {term: sensor}}\n" + rest),
            "a term of environment.observations has the name 'a b' but must have one of letters, "
            "digits and _.");
  EXPECT_EQ(refusal(rest),
            "environment.observations has no terms: say what is observed, e.g. joint_positions: "
            "{}.");
  EXPECT_EQ(refusal(std::string(kSeen) + kActed),
            "environment.rewards has no terms: say what is rewarded, e.g. alive: {weight: 1}.");
  EXPECT_EQ(refusal(std::string(kSeen) + kAlive),
            "environment.actions.control.actuators holds 'elbow', which has no control range: give "
            "it a ctrlrange in the model, or a limit here.");
  EXPECT_EQ(
      refusal("  observations: {a: {term: joint_positions}, b: {term: joint_positions}}\n" + rest),
      "environment 'mjcf' names two numbers of its observation 'root_x': give each a name of "
      "its own.");
}

TEST(MjcfFamily, WhatMujocoHasAgainstAModelIsPassedOn) {
  const TempDir dir;
  writeFile(dir / "bad.xml", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>");
  const std::string text =
      std::string("environment: {name: mjcf, model_file: bad.xml}\n") + "learner: sac\n";
  EXPECT_EQ(errorOf([&] { Experiment::parse(text, "a.yaml", {}, dir.path()); }),
            "MuJoCo refuses the model " + (dir / "bad.xml") +
                ": Error: mass and inertia of moving bodies must be larger than mjMINVAL, Object "
                "name = , id = 1, line = 1, column = -1.");
  EXPECT_EQ(
      errorOf([&] { Experiment::parse("environment: {name: mjcf}\nlearner: sac\n", "a.yaml"); }),
      "environment.model_file must name the robot: an MJCF or URDF file.");
}

std::string varied(const std::string& variations) {
  return std::string(kSeen) + kActed + "  rewards: {alive: {weight: 2}}\n" + "  variations:\n" +
         variations;
}

double figureOf(const Experiment& experiment, int task,
                const std::function<double(const mjModel*)>& figure) {
  return figure(experiment.family().make(task)->model()->get());
}

TEST(MjcfFamily, TasksDifferInNumbersOfTheModel) {
  const TempDir dir;
  const Experiment e = smallRobot(dir, varied(R"(
    pull: {term: gravity, values: [-9.81, -3.7, -1.6], test_values: [-5]}
    load: {term: body_mass, bodies: [lower], operation: add, values: [0, 0.1, 0.2], test_values: [0.4]}
    grip: {term: geom_friction, geoms: [floor], values: 0.5, test_values: 0.6}
    drag: {term: joint_damping, joints: [shoulder, elbow], operation: scale, values: 2, test_values: 1}
    power: {term: actuator_gain, actuators: [elbow], values: [1, 2, 3], test_values: 4}
    spring: {term: joint_stiffness, joints: [elbow], values: 7, test_values: 7}
)"));
  ASSERT_EQ(e.family().numTasks(), 3);
  ASSERT_EQ(e.family().numTestTasks(), 1);
  const auto body = e.family().make(0)->model()->body("lower");
  const auto figures = [&](int task) {
    std::vector<double> all;
    const auto env = e.family().make(task);
    const mjModel* m = env->model()->get();
    for (const double x : {m->opt.gravity[2], m->body_mass[body], m->geom_friction[0],
                           m->dof_damping[6], m->actuator_gainprm[mjNGAIN], m->jnt_stiffness[2]}) {
      all.push_back(x);
    }
    return all;
  };
  EXPECT_EQ(figures(0), (std::vector<double>{-9.81, 0.2, 0.5, 0.2, 1, 7}));
  EXPECT_EQ(figures(2), (std::vector<double>{-1.6, 0.4, 0.5, 0.2, 3, 7}));
  EXPECT_EQ(figures(3), (std::vector<double>{-5, 0.2 + 0.4, 0.6, 0.1, 4, 7}));
  EXPECT_EQ(e.family().taskDescription(1),
            "pull -3.7, load 0.1, grip 0.5, drag 2, power 2, spring 7");
  EXPECT_EQ(e.family().taskName(3), "task_test_0");
  // inertia goes with the mass, and what MuJoCo derives from them is worked out anew
  const auto inertia = [&](const mjModel* m) { return m->body_inertia[3 * body]; };
  EXPECT_DOUBLE_EQ(figureOf(e, 2, inertia), 2 * figureOf(e, 0, inertia));
  const auto subtree = [&](const mjModel* m) { return m->body_subtreemass[body]; };
  EXPECT_DOUBLE_EQ(figureOf(e, 2, subtree), 0.4);
}

TEST(MjcfFamily, ALinkOfAnotherLengthIsTheSameLinkStretched) {
  const TempDir dir;
  const Experiment e = smallRobot(dir, varied(R"(
    upper: {term: link_length, bodies: [upper], values: [1, 1.5]}
)"));
  MujocoModel model = e.family().make(1)->model()->copy();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  mj_kinematics(model.get(), data.get());
  const auto heightOf = [&](mjtObj kind, const char* name) {
    const int i = mj_name2id(model.get(), kind, name);
    return kind == mjOBJ_SITE ? data->site_xpos[3 * i + 2] : data->xpos[3 * i + 2];
  };
  EXPECT_NEAR(heightOf(mjOBJ_SITE, "elbow"), 0.9 - 0.45, 1e-12);
  EXPECT_NEAR(heightOf(mjOBJ_BODY, "lower"), 0.9 - 0.45, 1e-12);
  EXPECT_NEAR(heightOf(mjOBJ_SITE, "tip"), 0.9 - 0.65, 1e-12);
  const int geom = mj_name2id(model.get(), mjOBJ_GEOM, "upper");
  EXPECT_NEAR(model.get()->geom_size[3 * geom + 1], 0.225, 1e-12);
  EXPECT_NEAR(model.get()->geom_rbound[geom], 0.245, 1e-12);
  EXPECT_NEAR(model.get()->body_mass[model.body("upper")], 0.75, 1e-12);
}

TEST(MjcfFamily, TasksDifferInSettingsOfTerms) {
  const TempDir dir;
  const Experiment e = smallRobot(dir, varied(R"(
    worth: {term: setting, setting: alive.weight, operation: scale, values: [1, 3]}
    where: {term: setting, setting: goals.home.position, component: 2, values: [0.5, 0.7]}
  goals: {home: {term: point, position: [0.1, 0.2, 0.3]}}
)"));
  for (int task = 0; task < 2; ++task) {
    const auto env = e.family().make(task);
    test::Driven driven(*env);
    driven.reset();
    EXPECT_EQ(driven.step().reward, task == 0 ? 2 : 6);
  }
  EXPECT_EQ(refusal(varied("    v: {term: setting, setting: alive.wait, values: [1]}\n"))
                .rfind("unknown setting 'alive.wait' (named by environment.variations)", 0),
            0u);
  EXPECT_EQ(
      refusal(varied("    v: {term: setting, setting: observations.joint_positions.joints, "
                     "values: [1]}\n")),
      "environment.variations: environment.observations.joint_positions.joints is '[all]' but "
      "must be a number of the environment's, or a list and a component of it.");
}

TEST(MjcfFamily, DrawsTasksFromTheSeed) {
  const TempDir dir;
  const std::string terms = varied(R"(
    load: {term: body_mass, bodies: [lower], range: [0.1, 0.9]}
    grip: {term: geom_friction, geoms: [floor], range: [0.01, 1], distribution: log_uniform}
    drag: {term: joint_damping, operation: scale, range: [0.5, 2], independent: true}
  train_tasks: 120
  test_tasks: 2
)");
  const Experiment one = smallRobot(dir, terms, {"seed:=3"});
  const Experiment again = smallRobot(dir, terms, {"seed:=3", "train_tasks:=5"});
  const Experiment other = smallRobot(dir, terms, {"seed:=4", "train_tasks:=5"});
  std::vector<double> masses, grips;
  for (int task = 0; task < 120; ++task) {
    const mjModel* m = one.family().make(task)->model()->get();
    masses.push_back(m->body_mass[3]);
    grips.push_back(std::log10(m->geom_friction[0]));
    if (task >= 5) continue;
    EXPECT_EQ(one.family().taskDescription(task), again.family().taskDescription(task));
    EXPECT_NE(one.family().taskDescription(task), other.family().taskDescription(task));
    EXPECT_NE(m->dof_damping[6] / m->dof_damping[7], 1) << "each is drawn on its own";
  }
  test::expectUniform(masses, 0.1, 0.9);
  test::expectUniform(grips, -2, 0);
  EXPECT_EQ(one.family().taskDescription(121), again.family().taskDescription(6));
}

TEST(MjcfFamily, VariationsThatSayTooLittleOrTooMuchAreRefused) {
  EXPECT_EQ(refusal(varied("    v: {term: gravity}\n")),
            "environment.variations.v has neither values nor a range: give one of them.");
  EXPECT_EQ(refusal(varied("    v: {term: gravity, range: [1, 0]}\n  train_tasks: 2\n")),
            "environment.variations.v.range must be [low, high].");
  EXPECT_EQ(refusal(varied("    v: {term: gravity, range: [0, 1]}\n")),
            "environment.train_tasks is 0 but the variations are drawn: say how many tasks there "
            "are.");
  EXPECT_EQ(refusal(varied("    v: {term: gravity, values: [0, 1]}\n  test_tasks: 2\n")),
            "environment.variations.v has no test_values, and no range, for 2 test tasks: give one "
            "of them.");
  EXPECT_EQ(refusal(varied("    v: {term: gravity, values: [0, 1]}\n    w: {term: gravity, values: "
                           "[0, 1, 2]}\n")),
            "environment.variations.v.values has 2 values for 3 tasks: give one, or one for each "
            "task.");
  EXPECT_EQ(
      refusal(varied("    v: {term: body_mass, bodies: [lower], operation: add, values: -1}\n")),
      "environment.variations.v makes a number -0.8 but it must be at least 0.");
}

TEST(MjcfFamily, EffectiveSettingsReadBack) {
  const TempDir dir;
  const Experiment one = smallRobot(dir);
  const Experiment again = Experiment::parse(one.yaml(), "effective.yaml");
  EXPECT_EQ(again.yaml(), one.yaml());
  EXPECT_EQ(again.definingSettings(), one.definingSettings());
  EXPECT_NE(one.describe().find("environment.goals.reach.radius"), std::string::npos);
}

TEST(MjcfFamily, PresetsAndAssignmentsChangeSingleTerms) {
  const TempDir dir;
  const std::string terms = std::string(test::kSmallTerms) +
                            "presets: {dear: {environment: {rewards: {control_cost: {weight: -5}, "
                            "alive: {weight: 4}}}}}\n";
  const Experiment plain = smallRobot(dir, terms);
  const Experiment dear = smallRobot(dir, terms, {"preset:=dear", "near.weight:=3"});
  const auto differs = [&](const std::string& key, const std::string& now) {
    const auto of_dear = dear.definingSettings();
    EXPECT_EQ(of_dear.at("environment.rewards." + key), now);
  };
  differs("control_cost.weight", "-5");
  differs("alive.weight", "4");
  differs("near.weight", "3");
  EXPECT_EQ(plain.definingSettings().count("environment.rewards.alive.weight"), 0u);
}

TEST(MjcfFamily, ReadsAUrdf) {
  const TempDir dir;
  writeFile(dir / "arm.urdf", R"(<robot name="arm">
    <link name="base"/>
    <link name="link"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="hinge" type="revolute"><parent link="base"/><child link="link"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="5" velocity="3"/></joint></robot>)");
  const Experiment e = Experiment::parse(R"(learner: sac
environment:
  name: mjcf
  model_file: arm.urdf
  frame_skip: 10
  observations: {joint_positions: {}, joint_velocities: {}}
  actions: {joint_forces: {joints: [hinge], limit: 5}}
  rewards: {joint_position_error: {joint: hinge, target: 0.5, weight: -1}}
)",
                                         "arm.yaml", {}, dir.path());
  const auto env = e.family().make(0);
  test::Driven driven(*env);
  driven.reset();
  EXPECT_DOUBLE_EQ(driven.step().reward, -std::abs(driven.observation[0] - 0.5));
  driven.action = {1};
  for (int i = 0; i < 5; ++i) driven.step();
  EXPECT_GT(driven.observation[0], 0);
  EXPECT_EQ(env->spec().observation[1].name, "hinge_velocity");
}

TEST(MjcfFamily, EveryTermIsDescribed) {
  const std::string text = describeTerms();
  const auto expectAll = [&](const std::vector<std::string>& names) {
    for (const std::string& name : names) {
      EXPECT_NE(text.find("\n" + name + ": "), std::string::npos) << name;
    }
  };
  expectAll(termsOf<ObservationTerm>().names());
  expectAll(termsOf<ActionTerm>().names());
  expectAll(termsOf<RewardTerm>().names());
  expectAll(termsOf<TerminationTerm>().names());
  expectAll(termsOf<StartTerm>().names());
  expectAll(termsOf<GoalTerm>().names());
  expectAll(termsOf<VariationTerm>().names());
}

}  // namespace
}  // namespace pmeta
