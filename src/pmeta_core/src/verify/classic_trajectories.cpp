#include <utility>

#include "env_simulator.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/mountain_car.h"
#include "pmeta_core/env/sparse_point.h"

namespace pmeta {
namespace {

using Environments = std::vector<std::unique_ptr<Env>>;
/// The bound on the state after step t of an open loop.
using OpenLoopBound = std::function<double(int task, int t)>;

/// `absolute` holds up to step `until`.
struct Bound {
  int until;
  double absolute;
};

// rows of a discrete action, a state, reward and done
std::unique_ptr<TrajectorySimulator> makeClassic(Environments environments,
                                                 std::vector<std::string> state, bool knows_end,
                                                 OpenLoopBound open_loop) {
  const std::size_t state_size = state.size();
  Recording recording;
  recording.knows_end = knows_end;
  recording.inputs = {"action"};
  recording.state = std::move(state);
  recording.measures = {"reward"};
  recording.measure = [](const Env&, const Step& step, const double*, double* values) {
    values[0] = step.reward;
  };
  recording.tolerance = [open_loop = std::move(open_loop), state_size](
                            ReplayMode mode, int task, int t, std::size_t column, double) {
    const double bound = mode == ReplayMode::kSingleStep ? kRounding : open_loop(task, t);
    // reward and done are exact as long as the state is known
    return column < state_size || bound == kUnbounded ? bound : 0;
  };
  return std::make_unique<EnvSimulator>(std::move(environments), std::move(recording));
}

std::vector<CartPoleTask> cartPoleTasks(const std::string& tasks_file) {
  std::vector<CartPoleTask> tasks;
  if (tasks_file.empty()) {
    CartPoleFamily family;
    family.build(0);
    for (int i = 0; i < family.numTasks(); ++i) tasks.push_back(family.task(i));
  } else {
    for (const auto& values :
         readTasks(tasks_file, {"force_mag", "masspole", "length"}, Range::above(0))) {
      tasks.push_back({values[0], values[1], values[2]});
    }
  }
  return tasks;
}

// the unstable pole amplifies rounding, a short one sooner
double cartPoleBound(double length, int t) {
  static const std::vector<Bound> kLongPole = {{50, 1e-11}, {100, 1e-8}, {200, 1e-5}};
  static const std::vector<Bound> kShortPole = {{20, 1e-11}, {50, 1e-7}};
  constexpr double kShort = 0.25;  // m, half the pole's length
  for (const Bound& bound : length < kShort ? kShortPole : kLongPole) {
    if (t <= bound.until) return bound.absolute;
  }
  return kUnbounded;
}

std::vector<MountainCarTask> mountainCarTasks(const std::string& tasks_file) {
  std::vector<MountainCarTask> tasks;
  if (tasks_file.empty()) {
    MountainCarFamily family;
    family.build(0);
    for (int i = 0; i < family.numTasks(); ++i) tasks.push_back(family.task(i));
  } else {
    for (const auto& values :
         readTasks(tasks_file, {"zeta", "force", "gravity"}, Range::above(0))) {
      tasks.push_back({values[0], values[1], values[2]});
    }
  }
  return tasks;
}

}  // namespace

std::unique_ptr<TrajectorySimulator> makeCartPoleSimulator(const std::string& tasks_file) {
  const std::vector<CartPoleTask> tasks = cartPoleTasks(tasks_file);
  Environments environments;
  for (const CartPoleTask& task : tasks) environments.push_back(std::make_unique<CartPole>(task));
  return makeClassic(std::move(environments), {"x", "x_dot", "theta", "theta_dot"}, true,
                     [tasks](int task, int t) { return cartPoleBound(tasks[task].length, t); });
}

std::unique_ptr<TrajectorySimulator> makeMountainCarSimulator(const std::string& tasks_file) {
  Environments environments;
  for (const MountainCarTask& task : mountainCarTasks(tasks_file)) {
    environments.push_back(std::make_unique<MountainCar>(task));
  }
  return makeClassic(std::move(environments), {"position", "velocity"}, false,
                     [](int, int) { return kRounding; });
}

std::unique_ptr<TrajectorySimulator> makeSparsePointSimulator(const std::string& tasks_file) {
  requireTasksFile("sparse_point", tasks_file, "sparse_point_goals.csv");
  Environments environments;
  for (const auto& values : readTasks(tasks_file, {"goal_x", "goal_y"}, {})) {
    environments.push_back(std::make_unique<SparsePoint>(SparsePointTask{values[0], values[1]}));
  }
  Recording recording;
  recording.inputs = {"act_x", "act_y"};
  recording.state = {"pos_x", "pos_y"};
  recording.measures = {"reward_dense", "reward_sparse"};
  recording.measure = [](const Env&, const Step& step, const double*, double* values) {
    values[0] = step.reward;
    values[1] = step.evaluatedReward();
  };
  recording.tolerance = [](ReplayMode, int, int, std::size_t, double) { return kRounding; };
  return std::make_unique<EnvSimulator>(std::move(environments), std::move(recording));
}

}  // namespace pmeta
