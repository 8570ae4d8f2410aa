#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/fresh_evaluation.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/run/task_agent.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {

/// What a run in one process gives.
struct LocalResult {
  bool stopped = false;                  ///< before the last round
  std::vector<RoundBook::Round> rounds;  ///< in order, those before resumed_round apart
  Model meta;                            ///< the last meta-policy
  std::vector<FreshReturn> fresh;  ///< with fresh_episodes: the kept policies on fresh episodes
};

/// Called with the record of each round; false stops the run.
using OnRound = std::function<bool(const RoundBook::Round&)>;

/// Runs the whole experiment in this process and thread, with the very classes the nodes use and
/// the same result bit for bit. Files are written if `log` is given: those of RunLog, checkpoints
/// where settings ask for them, and the last policies below policies/, a stopped run's too. If it
/// throws, the manifest says "failed" and why; so it does at the first TaskFailed, whatever the
/// quorum: nobody is late in one process.
///
/// With `resumed_round`, from findResumePoint(), the run goes on from that round's checkpoints; the
/// rounds before are then missing from the result. `log` must be that of RunLog::reopen().
LocalResult runLocally(const Experiment& experiment, RunLog* log = nullptr,
                       const OnRound& on_round = {}, int resumed_round = 0);

/// Where a run in this experiment's folder can go on.
struct ResumePoint {
  int round = 0;                     ///< of the checkpoints
  int rounds_done = 0;               ///< rounds whose record is complete, for RunLog::reopen()
  std::vector<std::string> refused;  ///< newer checkpoints that are not good, one sentence each
};

/// The newest round of which the aggregator and every agent have a good checkpoint. Throws Error if
/// there is none, or the run is finished.
ResumePoint findResumePoint(const Experiment& experiment);

}  // namespace pmeta
