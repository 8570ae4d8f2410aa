#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"

namespace pmeta {

/// One experiment over every combination of some settings' values.
struct SweepPlan {
  std::string name;    ///< runs go to RESULTS_DIR/sweeps/NAME/EXPERIMENT/RUN_ID
  std::string config;  ///< path of the settings file
  /// "key:=a,b,c", "seed:=0-9" or "seed:=0-2,5" (ranges of whole numbers), or "key:=value" for
  /// all runs.
  std::vector<std::string> assignments;
  int jobs = 1;  ///< runs at a time, one thread each
  /// Runs make checkpoints (checkpoint.interval), and one that was cut off goes on from them;
  /// otherwise it begins anew.
  bool resume = false;
};

/// Progress of a sweep after one more run.
struct SweepProgress {
  int done = 0;                ///< runs finished or found finished
  int total = 0;               ///< runs of the plan
  bool skipped = false;        ///< this one was found finished
  std::string in_use;          ///< this one is left to whom else writes it, as a sentence; or ""
  std::string run_id;          ///< of this one
  double personal_return = 0;  ///< of the run's last round; NaN if it was not run
  double meta_return = 0;      ///< the same of the meta-policy
  double seconds = 0;          ///< of this run
  double eta_seconds = 0;      ///< for the rest
};

/// Throws Error if the run's folder holds a run with other defining settings, but for the
/// run's name.
void requireSameSettings(const Experiment& experiment);

/// A run of a sweep that ended with an error.
struct SweepFailure {
  std::string run_id;  ///< of the run that failed
  std::string reason;  ///< a sentence
};

/// What a sweep gives.
struct SweepResult {
  std::string folder;                  ///< that holds the runs
  int total = 0;                       ///< runs of the plan
  int in_use = 0;                      ///< of these, left to whom else writes them
  bool stopped = false;                ///< before each had its turn
  std::vector<SweepFailure> failures;  ///< in the order of the plan
};

/// The runs of a plan, checked, each once: combinations with equal effective settings (an algorithm
/// may fix some) are one run. Throws Error before anything is run, also if a run has other settings
/// under the same name.
std::vector<Experiment> planSweep(const SweepPlan& plan);

/// Runs what is not finished yet, `plan.jobs` at a time; what somebody else writes is left alone. A
/// run that fails keeps no other from being run: its manifest says "failed" and why, and the next
/// sweep of the plan tries it again. Stops early, keeping what is finished, when `stop` becomes
/// true. Calls on_progress from one thread at a time.
SweepResult runSweep(const SweepPlan& plan, const std::atomic<bool>& stop,
                     const std::function<void(const SweepProgress&)>& on_progress);

}  // namespace pmeta
