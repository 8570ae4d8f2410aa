// The shipped MuJoCo families, written as robots in YAML, are what they are in C++.
#include <gtest/gtest.h>

#include <mujoco/mujoco.h>

#include <set>

#include "../env/continuous_env.h"
#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"
#include "pmeta_core/mjcf/mjcf_env.h"

namespace pmeta {
namespace {

using test::Driven;

constexpr double kTolerance = 1e-12;

Experiment inYaml(const std::string& name, const std::vector<std::string>& more = {}) {
  return Experiment::load(std::string(PMETA_TEST_DATA "/mjcf/") + name + ".yaml", more);
}

/// From the same draws on, both start, go on and end alike.
void expectAlike(Env& one, Env& other, int episodes) {
  ASSERT_EQ(one.spec().observation_size, other.spec().observation_size);
  ASSERT_EQ(one.spec().action_size, other.spec().action_size);
  EXPECT_EQ(one.spec().horizon, other.spec().horizon);
  EXPECT_EQ(one.spec().step_seconds, other.spec().step_seconds);
  Driven a(one), b(other);
  for (int episode = 0; episode < episodes; ++episode) {
    a.reset();
    b.reset();
    Step step;
    while (!step.terminated && !step.truncated) {
      for (std::size_t i = 0; i < a.observation.size(); ++i) {
        ASSERT_NEAR(a.observation[i], b.observation[i], kTolerance) << i;
      }
      step = a.randomStep();
      const Step same = b.randomStep();
      ASSERT_NEAR(step.reward, same.reward, kTolerance);
      ASSERT_EQ(step.sparse_reward, same.sparse_reward);
      ASSERT_EQ(step.terminated, same.terminated);
      ASSERT_EQ(step.truncated, same.truncated);
    }
  }
}

void expectSameNames(const EnvSpec& one, const EnvSpec& other) {
  for (int i = 0; i < one.observation_size; ++i) {
    EXPECT_EQ(one.observation[i].name, other.observation[i].name);
    EXPECT_EQ(one.observation[i].unit, other.observation[i].unit);
    EXPECT_EQ(one.observation[i].low, other.observation[i].low) << one.observation[i].name;
    EXPECT_EQ(one.observation[i].high, other.observation[i].high) << one.observation[i].name;
  }
  for (int i = 0; i < one.action_size; ++i) EXPECT_EQ(one.action[i].name, other.action[i].name);
}

TEST(MjcfOracle, HalfCheetahDir) {
  const Experiment yaml = inYaml("half_cheetah_dir");
  test::BuiltFamily<HalfCheetahDirFamily> built;
  ASSERT_EQ(yaml.family().numTasks(), built.family.numTasks());
  ASSERT_EQ(yaml.family().numTestTasks(), built.family.numTestTasks());
  for (int task = 0; task < 4; ++task) {
    const auto one = built.family.make(task), other = yaml.family().make(task);
    expectAlike(*one, *other, 2);
    expectSameNames(one->spec(), other->spec());
  }
}

// of the original: what Gym observed and rewarded, from each recorded state on
TEST(MjcfOracle, HalfCheetahDirStepsAsTheRecordedTrajectory) {
  const CsvTable table = CsvTable::load(PMETA_TEST_DATA "/half_cheetah_traj.csv.gz");
  const auto env = inYaml("half_cheetah_dir").family().make(1);
  std::vector<double> observation(20), action(6);
  Rng rng(0, 0, Stream::kMeasure);
  const auto at = [&](std::size_t row, const std::string& name) {
    return table.number(row, table.column(name));
  };
  const auto all = [&](std::size_t row, const std::string& name, std::size_t count) {
    std::vector<double> values;
    for (std::size_t i = 0; i < count; ++i) values.push_back(at(row, name + std::to_string(i)));
    return values;
  };
  int compared = 0;
  for (std::size_t row = 0; row + 1 < table.numRows(); ++row) {
    if (at(row, "seq") != at(row + 1, "seq")) continue;
    env->reset(rng, observation.data());
    std::vector<double> state = env->state();
    std::size_t next = 0;
    const auto take = [&](const std::vector<double>& values) {
      for (const double value : values) state[next++] = value;
    };
    take(all(row, "qpos_", 9));
    take(all(row, "qvel_", 9));
    take(all(row, "warm_", 9));
    state[state.size() - 2] = at(row, "qpos_0");  // what the reward remembers
    env->setState(state);
    action = all(row + 1, "act_", 6);
    const Step step = env->step(action.data(), rng, observation.data());
    // recorded on another machine: of velocities over 0.05 s
    ASSERT_NEAR(step.reward, at(row + 1, "reward_forward"), 1e-7) << row;
    const std::vector<double> seen = all(row + 1, "obs_", 20);
    for (std::size_t i = 0; i < 20; ++i) {
      ASSERT_NEAR(observation[i], seen[i], 1e-6 * std::max(1.0, std::abs(seen[i]))) << row;
    }
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(MjcfOracle, HalfCheetahVelDrawsTheSameTargets) {
  const Experiment yaml = inYaml("half_cheetah_vel", {"seed:=7"});
  test::BuiltFamily<HalfCheetahVelFamily> built({}, 7);
  ASSERT_EQ(yaml.family().numTasks(), 10);
  ASSERT_EQ(yaml.family().numTestTasks(), 3);
  for (const int task : {0, 9, 10, 12}) {
    const auto one = built.family.make(task), other = yaml.family().make(task);
    expectAlike(*one, *other, 1);
    EXPECT_EQ(yaml.family().taskDescription(task),
              "velocity " + formatNumber(built.family.task(task).value));
  }
}

TEST(MjcfOracle, AntFwdBack) {
  const Experiment yaml = inYaml("ant_fwd_back");
  test::BuiltFamily<AntFwdBackFamily> built;
  ASSERT_EQ(yaml.totalTasks(), 2);
  ASSERT_EQ(yaml.family().numTestTasks(), 2);
  for (int task = 0; task < 2; ++task) {
    const auto one = built.family.make(task), other = yaml.family().make(task);
    expectAlike(*one, *other, 4);
  }
}

/// Factors of a walker's task as variations of one value each, in the order of the model.
std::vector<std::string> asVariations(const MujocoModel& model, const Walker2dTask& task) {
  std::string text;
  int count = 0;
  const auto add = [&](const std::string& what, double factor) {
    text += "\n    v" + std::to_string(count++) + ": {" + what +
            ", operation: scale, values: " + formatNumber(factor) + "}";
  };
  const mjModel* m = model.get();
  for (int body = 0; body < m->nbody; ++body) {
    const std::string of = "bodies: [" + std::string(mj_id2name(m, mjOBJ_BODY, body)) + "]";
    add("term: body_mass, inertia: false, " + of, task.body_mass[body]);
    for (int axis = 0; axis < 3; ++axis) {
      add("term: body_inertia, axes: [" + std::string(1, "xyz"[axis]) + "], " + of,
          task.body_inertia[3 * body + axis]);
    }
  }
  for (int joint = 0; joint < m->njnt; ++joint) {
    add("term: joint_damping, joints: [" + std::string(mj_id2name(m, mjOBJ_JOINT, joint)) + "]",
        task.dof_damping[joint]);
  }
  const char* kinds[] = {"sliding", "torsional", "rolling"};
  for (int geom = 0; geom < m->ngeom; ++geom) {
    for (int kind = 0; kind < 3; ++kind) {
      add("term: geom_friction, geoms: [" + std::string(mj_id2name(m, mjOBJ_GEOM, geom)) +
              "], kinds: [" + kinds[kind] + "]",
          task.geom_friction[3 * geom + kind]);
    }
  }
  return {text};
}

TEST(MjcfOracle, Walker2dParamsWithTheFactorsOfEachTask) {
  const test::BuiltFamily<Walker2dParamsFamily> built;
  const std::string file = PMETA_TEST_DATA "/mjcf/walker_2d_params.yaml";
  std::string text = test::readFile(file);
  text.resize(text.find("  variations:"));
  for (const int task : {0, 4, 11}) {
    const auto base = MujocoModel::open("", Walker2d::layout());
    const std::string yaml =
        text + "  variations:" + asVariations(*base, built.family.task(task)).front() + "\n";
    const Experiment experiment = Experiment::parse(
        yaml, "walker.yaml", {"train_tasks:=1", "test_tasks:=0"}, PMETA_TEST_DATA "/mjcf");
    const auto one = built.family.make(task), other = experiment.family().make(0);
    expectAlike(*one, *other, 8);
    expectSameNames(one->spec(), other->spec());
  }
}

TEST(MjcfOracle, Walker2dParamsDrawsModelsOfTheSameKind) {
  const Experiment yaml = inYaml("walker_2d_params");
  ASSERT_EQ(yaml.family().numTasks(), 10);
  ASSERT_EQ(yaml.family().numTestTasks(), 3);
  const auto base = MujocoModel::open("", Walker2d::layout());
  std::set<double> masses;
  for (int task = 0; task < 13; ++task) {
    const mjModel* m = yaml.family().make(task)->model()->get();
    for (int body = 1; body < m->nbody; ++body) {
      const double factor = m->body_mass[body] / base->get()->body_mass[body];
      EXPECT_GE(factor, 0.29);
      EXPECT_LE(factor, 3.4);
      masses.insert(factor);
    }
  }
  EXPECT_EQ(masses.size(), 13u * 7) << "each is drawn on its own";
}

}  // namespace
}  // namespace pmeta
