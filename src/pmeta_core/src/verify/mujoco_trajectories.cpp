#include <algorithm>
#include <cmath>
#include <utility>

#include "env_simulator.h"
#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"
#include "pmeta_core/env/walker2d_tasks.h"

namespace pmeta {
namespace {

using Environments = std::vector<std::unique_ptr<Env>>;

// contacts amplify rounding: an open loop is bounded for a few steps only
double stateBound(ReplayMode mode, int t) {
  if (mode == ReplayMode::kSingleStep || t <= 10) return 1e-9;
  return t <= 15 ? 1e-6 : kUnbounded;
}

// two units in the last place of single precision
double singleBound(double recorded) {
  const auto rounded = static_cast<float>(std::abs(recorded));
  return 2.0 * (std::nextafter(rounded, std::numeric_limits<float>::infinity()) - rounded);
}

// rows of an action, the engine's state, observation, what the reward is made of, and done
std::unique_ptr<TrajectorySimulator> makeRecorded(Environments environments,
                                                  const MujocoLayout& layout, Recording recording) {
  const int num_actions = static_cast<int>(layout.motors.size());
  recording.inputs = concatenated({numbered("act", num_actions), recording.inputs});
  recording.state = concatenated({numbered("qpos", layout.nq),
                                  numbered("qvel", layout.nv),
                                  numbered("warm", layout.nv),
                                  {"torso_x", "torso_y", "torso_z"}});
  recording.has_observation = true;

  const EnvSpec& spec = environments.front()->spec();
  const bool single_precision = layout.model == HalfCheetah::layout().model;
  const auto warm = static_cast<std::size_t>(layout.nq + layout.nv);
  const std::size_t torso = warm + static_cast<std::size_t>(layout.nv);
  const std::size_t observation = torso + 3;
  const std::size_t measures = observation + static_cast<std::size_t>(spec.observation_size);
  const std::size_t done = measures + recording.measures.size();
  recording.tolerance = [=](ReplayMode mode, int, int t, std::size_t column, double recorded) {
    const double bound = stateBound(mode, t);
    if (bound == kUnbounded) return bound;
    if (column == done) return 0.0;
    // velocities divide by the time of a step, accelerations by that of a timestep
    if (column >= measures) return 100 * bound;
    if (column >= warm && column < torso) return 1000 * bound;
    if (column >= observation && single_precision) return std::max(bound, singleBound(recorded));
    return bound;
  };
  return std::make_unique<EnvSimulator>(std::move(environments), std::move(recording));
}

void refuseTasksFile(const std::string& kind, const std::string& tasks_file) {
  if (tasks_file.empty()) return;
  throw Error("trajectories of " + kind + " have no tasks: leave out --tasks.");
}

std::unique_ptr<TrajectorySimulator> makeWalkers(Environments environments, bool has_task) {
  Recording recording;
  recording.has_task = has_task;
  recording.measures = {"forward_vel", "alive", "ctrl_cost", "reward"};
  recording.measure = [](const Env& env, const Step& step, const double*, double* values) {
    const auto& walker = static_cast<const Walker2d&>(env);
    values[0] = walker.forwardVelocity();
    values[1] = Walker2d::aliveBonus();
    values[2] = walker.controlCost();
    values[3] = step.reward;
  };
  return makeRecorded(std::move(environments), Walker2d::layout(), std::move(recording));
}

}  // namespace

std::unique_ptr<TrajectorySimulator> makeHalfCheetahSimulator(const std::string& tasks_file) {
  refuseTasksFile("half_cheetah", tasks_file);
  using Goal = HalfCheetahTask::Goal;
  Environments environments;
  environments.push_back(std::make_unique<HalfCheetah>(
      HalfCheetahTask{Goal::kDirection, 1}, MujocoModel::open("", HalfCheetah::layout())));
  Recording recording;
  recording.has_task = false;
  recording.inputs = {"target_vel"};
  recording.measures = {"forward_vel", "ctrl_cost", "reward_forward", "reward_backward",
                        "reward_vel"};
  recording.measure = [](const Env& env, const Step& step, const double* inputs, double* values) {
    const auto& cheetah = static_cast<const HalfCheetah&>(env);
    const double velocity = cheetah.forwardVelocity();
    const double cost = cheetah.controlCost();
    const double target = inputs[env.spec().action_size];
    values[0] = velocity;
    values[1] = cost;
    values[2] = step.reward;
    values[3] = HalfCheetah::reward({Goal::kDirection, -1}, velocity, cost);
    values[4] = HalfCheetah::reward({Goal::kVelocity, target}, velocity, cost);
  };
  return makeRecorded(std::move(environments), HalfCheetah::layout(), std::move(recording));
}

std::unique_ptr<TrajectorySimulator> makeAntSimulator(const std::string& tasks_file) {
  refuseTasksFile("ant", tasks_file);
  Environments environments;
  environments.push_back(std::make_unique<Ant>(0, MujocoModel::open("", Ant::layout())));
  Recording recording;
  recording.has_task = false;
  recording.measures = {"vel_x",
                        "vel_y",
                        "ctrl_cost",
                        "contact_cost",
                        "survive",
                        "reward_fwd",
                        "reward_back",
                        "reward_fwd_nocontact",
                        "reward_back_nocontact"};
  recording.measure = [](const Env& env, const Step& step, const double*, double* values) {
    constexpr double kBackward = 3.141592653589793;
    const AntStep& last = static_cast<const Ant&>(env).lastStep();
    AntStep without_contact = last;
    without_contact.contact_cost = 0;
    values[0] = last.velocity_x;
    values[1] = last.velocity_y;
    values[2] = last.control_cost;
    values[3] = last.contact_cost;
    values[4] = last.survive;
    values[5] = step.reward;
    values[6] = Ant::reward(kBackward, last);
    values[7] = Ant::reward(0, without_contact);
    values[8] = Ant::reward(kBackward, without_contact);
  };
  return makeRecorded(std::move(environments), Ant::layout(), std::move(recording));
}

std::unique_ptr<TrajectorySimulator> makeWalker2dSimulator(const std::string& tasks_file) {
  refuseTasksFile("walker2d", tasks_file);
  Environments environments;
  environments.push_back(std::make_unique<Walker2d>(MujocoModel::open("", Walker2d::layout())));
  return makeWalkers(std::move(environments), false);
}

std::unique_ptr<TrajectorySimulator> makeWalker2dParamsSimulator(const std::string& tasks_file) {
  requireTasksFile("walker2d_params", tasks_file, "walker2d_params_tasks.csv");
  const auto base = MujocoModel::open("", Walker2d::layout());
  Environments environments;
  for (const Walker2dTask& task : readWalker2dTasks(tasks_file, *base)) {
    environments.push_back(std::make_unique<Walker2d>(applyWalker2dTask(*base, task)));
  }
  return makeWalkers(std::move(environments), true);
}

}  // namespace pmeta
