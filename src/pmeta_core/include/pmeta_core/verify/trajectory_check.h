#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/verify/trajectory_simulator.h"

namespace pmeta {

/// The largest difference between a recorded and a simulated number, and the line where it is; 0
/// where all are equal.
struct LargestError {
  double value = 0;  ///< absolute; infinite where the simulated number is not finite
  long line = 0;     ///< of the file, counted from 1; 0 where there is no error
};

/// What a replay found in one column.
struct ColumnErrors {
  std::string column;        ///< its name in the file
  LargestError single_step;  ///< each step from the row recorded before it
  LargestError open_loop;    ///< as far as a tolerance holds
  LargestError unbounded;    ///< open loop, where rounding has grown beyond any tolerance
};

/// One number that lies beyond its tolerance.
struct Deviation {
  ReplayMode mode = ReplayMode::kSingleStep;  ///< the simulation that went astray
  long line = 0;                              ///< of the file, counted from 1
  std::string column;                         ///< its name in the file
  int task = 0;                               ///< 0 where the file has no column for it
  int seq = 0;                                ///< sequence, as the file numbers them
  int t = 0;                                  ///< step within the sequence, at least 1
  double recorded = 0;                        ///< what the file says
  double simulated = 0;                       ///< what the environment gave
  double tolerance = 0;                       ///< largest difference that is allowed here
};

/// What checkTrajectories found.
struct TrajectoryReport {
  std::string kind;          ///< as given to checkTrajectories()
  std::string path;          ///< of the file
  int sequences = 0;         ///< how many begin in the file
  long steps = 0;            ///< steps that were simulated, in each mode
  long unbounded_steps = 0;  ///< of those, how many no tolerance of the open loop holds for
  std::vector<ColumnErrors> columns;  ///< those compared, in the simulator's order
  long deviations = 0;                ///< numbers beyond their tolerance
  std::optional<Deviation> first;     ///< the first of them, in the order of the file

  bool ok() const { return deviations == 0; }  ///< does every number lie within its tolerance?
};

/// Simulates every recorded step of a trajectory file again, one at a time and open loop, and
/// compares; `kind` and `tasks_file` as for makeTrajectorySimulator.
///
/// Rows with t = 0 are starts and only the steps from them are compared, so that a wrong number
/// there shows in the row after. Throws Error if the file is not a trajectory file of that kind.
TrajectoryReport checkTrajectories(const std::string& kind, const std::string& path,
                                   const std::string& tasks_file = "");

/// The report for people: the largest errors of each column, and whether all is well.
std::string trajectoryTable(const TrajectoryReport& report);

}  // namespace pmeta
