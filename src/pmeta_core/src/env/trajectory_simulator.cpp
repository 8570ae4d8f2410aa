#include "pmeta_core/env/trajectory_simulator.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/rng.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/mountain_car.h"

namespace pmeta {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-12;  ///< what one step, or any step of tame dynamics, may differ by

/// `absolute` holds up to step `until`.
struct Bound {
  int until;
  double absolute;
};

// an Env whose rows hold its state, then reward and done
class EnvSimulator : public TrajectorySimulator {
 public:
  using Environments = std::vector<std::unique_ptr<Env>>;
  /// The bound on the state after step t of an open loop.
  using OpenLoopBound = std::function<double(int task, int t)>;

  /// `knows_end`: the environment's state says, after the columns `state`, whether it has ended.
  EnvSimulator(Environments environments, std::vector<std::string> state, bool knows_end,
               OpenLoopBound open_loop)
      : environments_(std::move(environments)),
        knows_end_(knows_end),
        open_loop_(std::move(open_loop)) {
    columns_.has_task = true;
    columns_.num_actions = environments_.front()->spec().num_actions;
    columns_.inputs = {"action"};
    columns_.state = std::move(state);
    columns_.compared = columns_.state;
    columns_.compared.insert(columns_.compared.end(), {"reward", "done"});
    observation_.resize(environments_.front()->spec().observation_size);
  }

  const TrajectoryColumns& columns() const override { return columns_; }
  int numTasks() const override { return static_cast<int>(environments_.size()); }

  void start(int task, const double* state, bool ended) override {
    env_ = environments_.at(task).get();
    std::vector<double> full(state, state + columns_.state.size());
    if (knows_end_) full.push_back(ended ? 1 : 0);
    full.push_back(0);  // time limits are not recorded: count no steps
    env_->setState(full);
  }

  void step(const double* inputs, double* compared) override {
    const Step step = env_->step(inputs, rng_, observation_.data());
    compared = std::copy_n(env_->state().begin(), columns_.state.size(), compared);
    compared[0] = step.reward;
    compared[1] = step.terminated ? 1 : 0;
  }

  double tolerance(ReplayMode mode, int task, int t, std::size_t column, double) const override {
    const double bound = mode == ReplayMode::kSingleStep ? kRounding : open_loop_(task, t);
    // reward and done are exact as long as the state is known
    return column < columns_.state.size() || bound == kUnbounded ? bound : 0;
  }

 private:
  Environments environments_;
  bool knows_end_;
  OpenLoopBound open_loop_;
  TrajectoryColumns columns_;
  Env* env_ = nullptr;
  Rng rng_{0, 0, Stream::kMeasure};  ///< unused: these environments draw only at a reset
  std::vector<double> observation_;
};

// the task constants in a file's `columns`, after its column "task", which counts from 0
std::vector<std::vector<double>> readTasks(const std::string& path,
                                           const std::vector<std::string>& columns) {
  const CsvTable table = CsvTable::load(path);
  const std::size_t task_column = table.column("task");
  std::vector<std::vector<double>> tasks(table.numRows());
  for (std::size_t row = 0; row < tasks.size(); ++row) {
    if (table.wholeNumber(row, task_column) != static_cast<int>(row)) {
      table.refuse(row, task_column, std::to_string(row) + ": tasks count from 0");
    }
    for (const std::string& name : columns) {
      tasks[row].push_back(table.number(row, table.column(name), Range::above(0)));
    }
  }
  if (tasks.empty()) throw Error(path + " holds no tasks, only a header.");
  return tasks;
}

std::vector<CartPoleTask> cartPoleTasks(const std::string& tasks_file) {
  std::vector<CartPoleTask> tasks;
  if (tasks_file.empty()) {
    CartPoleFamily family;
    family.build(0);
    for (int i = 0; i < family.numTasks(); ++i) tasks.push_back(family.task(i));
  } else {
    for (const auto& values : readTasks(tasks_file, {"force_mag", "masspole", "length"})) {
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

std::unique_ptr<TrajectorySimulator> makeCartPole(const std::string& tasks_file) {
  const std::vector<CartPoleTask> tasks = cartPoleTasks(tasks_file);
  EnvSimulator::Environments environments;
  for (const CartPoleTask& task : tasks) environments.push_back(std::make_unique<CartPole>(task));
  return std::make_unique<EnvSimulator>(
      std::move(environments), std::vector<std::string>{"x", "x_dot", "theta", "theta_dot"}, true,
      [tasks](int task, int t) { return cartPoleBound(tasks[task].length, t); });
}

std::vector<MountainCarTask> mountainCarTasks(const std::string& tasks_file) {
  std::vector<MountainCarTask> tasks;
  if (tasks_file.empty()) {
    MountainCarFamily family;
    family.build(0);
    for (int i = 0; i < family.numTasks(); ++i) tasks.push_back(family.task(i));
  } else {
    for (const auto& values : readTasks(tasks_file, {"zeta", "force", "gravity"})) {
      tasks.push_back({values[0], values[1], values[2]});
    }
  }
  return tasks;
}

std::unique_ptr<TrajectorySimulator> makeMountainCar(const std::string& tasks_file) {
  EnvSimulator::Environments environments;
  for (const MountainCarTask& task : mountainCarTasks(tasks_file)) {
    environments.push_back(std::make_unique<MountainCar>(task));
  }
  return std::make_unique<EnvSimulator>(std::move(environments),
                                        std::vector<std::string>{"position", "velocity"}, false,
                                        [](int, int) { return kRounding; });
}

using Factory = std::function<std::unique_ptr<TrajectorySimulator>(const std::string& tasks_file)>;

// every kind of trajectory file; a new one adds its line here
const std::map<std::string, Factory>& kinds() {
  static const std::map<std::string, Factory> kKinds = {
      {"cartpole", makeCartPole},
      {"mountaincar", makeMountainCar},
  };
  return kKinds;
}

}  // namespace

std::vector<std::string> trajectoryKinds() {
  std::vector<std::string> names;
  for (const auto& kind : kinds()) names.push_back(kind.first);
  return names;
}

std::unique_ptr<TrajectorySimulator> makeTrajectorySimulator(const std::string& kind,
                                                             const std::string& tasks_file) {
  const auto found = kinds().find(kind);
  if (found == kinds().end()) {
    const std::string guess = nearest(kind, trajectoryKinds());
    throw Error("unknown trajectories '" + kind + "'" +
                (guess.empty() ? "." : ": did you mean '" + guess + "'?") + " Known are " +
                join(trajectoryKinds()) + ".");
  }
  return found->second(tasks_file);
}

}  // namespace pmeta
