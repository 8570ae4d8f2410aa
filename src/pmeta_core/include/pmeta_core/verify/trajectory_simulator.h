#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace pmeta {

/// How recorded trajectories are re-simulated.
enum class ReplayMode {
  kSingleStep,  ///< each step from the row recorded before it
  kOpenLoop,    ///< all steps from the first row of their sequence
};

/// The columns of one kind of trajectory file, beside "seq", "t" and "done".
struct TrajectoryColumns {
  bool has_task = false;              ///< a column "task" says of which task a sequence is
  int num_actions = 0;                ///< discrete actions, the first input; 0: continuous
  std::vector<std::string> inputs;    ///< what a step is given, from its own row
  std::vector<std::string> state;     ///< what a step starts from
  std::vector<std::string> compared;  ///< what a step gives
};

/// Steps one environment as a kind of trajectory file records it, for checkTrajectories.
///
/// A new kind derives from this and adds its line to the table in trajectory_simulator.cpp.
class TrajectorySimulator {
 public:
  virtual ~TrajectorySimulator() = default;

  /// What the file must have; the same for as long as this lives.
  virtual const TrajectoryColumns& columns() const = 0;
  virtual int numTasks() const = 0;  ///< tasks that start() takes, from 0

  /// Takes up a recorded state of `task`: columns().state.size() numbers. `ended`: this row of the
  /// sequence, or one before it, was terminal.
  virtual void start(int task, const double* state, bool ended) = 0;

  /// Acts once: reads columns().inputs.size() numbers, writes columns().compared.size() numbers.
  virtual void step(const double* inputs, double* compared) = 0;

  /// How far columns().compared[column] may lie from `recorded` after step t of a sequence;
  /// infinity where rounding has grown beyond any bound.
  virtual double tolerance(ReplayMode mode, int task, int t, std::size_t column,
                           double recorded) const = 0;
};

/// The simulator for that kind of file, e.g. "cartpole". Its tasks are the paper's unless
/// `tasks_file` names a *_tasks.csv. Throws Error listing the known kinds, or saying what is wrong
/// with the tasks.
std::unique_ptr<TrajectorySimulator> makeTrajectorySimulator(const std::string& kind,
                                                             const std::string& tasks_file = "");

/// Kinds that makeTrajectorySimulator knows.
std::vector<std::string> trajectoryKinds();

}  // namespace pmeta
