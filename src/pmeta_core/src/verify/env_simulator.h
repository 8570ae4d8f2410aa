#pragma once

#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/verify/trajectory_simulator.h"

namespace pmeta {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-12;  ///< what one step, or any step of tame dynamics, may differ by

/// All of these names, one list after the other.
std::vector<std::string> concatenated(std::initializer_list<std::vector<std::string>> lists);

/// "name_0" to "name_<count - 1>".
std::vector<std::string> numbered(const std::string& name, int count);

/// How a file records an environment, and how far a simulation may lie from it.
struct Recording {
  bool has_task = true;
  bool knows_end = false;  ///< after the columns `state`, the environment's state says if it ended
  std::vector<std::string> inputs;    ///< the action first
  std::vector<std::string> state;     ///< the environment's, but for end and steps
  bool has_observation = false;       ///< columns obs_0, obs_1, ...
  std::vector<std::string> measures;  ///< what `measure` works out
  /// Writes the columns `measures` of the step that `env` has just made.
  std::function<void(const Env& env, const Step& step, const double* inputs, double* values)>
      measure;
  /// As TrajectorySimulator::tolerance.
  std::function<double(ReplayMode mode, int task, int t, std::size_t column, double recorded)>
      tolerance;
};

/// Simulates environments, one for each task. Compared are the state, the observation where it is
/// recorded, the measures and done.
class EnvSimulator : public TrajectorySimulator {
 public:
  EnvSimulator(std::vector<std::unique_ptr<Env>> environments, Recording recording);

  const TrajectoryColumns& columns() const override { return columns_; }
  int numTasks() const override { return static_cast<int>(environments_.size()); }
  void start(int task, const double* state, bool ended) override;
  void step(const double* inputs, double* compared) override;
  double tolerance(ReplayMode mode, int task, int t, std::size_t column,
                   double recorded) const override {
    return recording_.tolerance(mode, task, t, column, recorded);
  }

 private:
  std::vector<std::unique_ptr<Env>> environments_;
  Recording recording_;
  TrajectoryColumns columns_;
  Env* env_ = nullptr;
  Rng rng_{0, 0, Stream::kMeasure};  ///< unused: these environments draw only at a reset
  std::vector<double> observation_;
};

/// The task constants in a file's `columns`, each in `range`; its column "task" counts from 0.
std::vector<std::vector<double>> readTasks(const std::string& path,
                                           const std::vector<std::string>& columns,
                                           const Range& range);

/// Throws Error unless there is a file of tasks, for kinds without tasks of their own.
void requireTasksFile(const std::string& kind, const std::string& tasks_file,
                      const std::string& example);

// the kinds of trajectory files
std::unique_ptr<TrajectorySimulator> makeCartPoleSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeMountainCarSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeSparsePointSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeHalfCheetahSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeAntSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeWalker2dSimulator(const std::string& tasks_file);
std::unique_ptr<TrajectorySimulator> makeWalker2dParamsSimulator(const std::string& tasks_file);

}  // namespace pmeta
