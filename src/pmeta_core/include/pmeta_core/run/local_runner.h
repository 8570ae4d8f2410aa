#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/fresh_evaluation.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/run/run_log.h"
#include "pmeta_core/run/task_agent.h"

namespace pmeta {

/// What a run in one process gives.
struct LocalResult {
  bool stopped = false;  ///< before the last round
  std::vector<RoundBook::Round> rounds;
  Model meta;                      ///< the last meta-policy
  std::vector<FreshReturn> fresh;  ///< with fresh_episodes: the kept policies on fresh episodes
};

/// Called with the record of each round; false stops the run.
using OnRound = std::function<bool(const RoundBook::Round&)>;

/// Runs the whole experiment in this process and thread, with the very classes the nodes use and
/// the same result bit for bit. Files are written if `log` is given: those of RunLog, and the last
/// policies below policies/, a stopped run's too.
LocalResult runLocally(const Experiment& experiment, RunLog* log = nullptr,
                       const OnRound& on_round = {});

}  // namespace pmeta
