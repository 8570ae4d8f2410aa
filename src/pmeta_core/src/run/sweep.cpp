#include "pmeta_core/run/sweep.h"

#include <chrono>
#include <exception>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <thread>

#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

bool isFinished(const Experiment& experiment) {
  return runStatus(experiment.runDir()) == "finished";
}

struct BegunRun {
  RunLog log;
  int round;  // of the checkpoints from which it goes on; 0: it begins anew
};

// the folder of the run, where it was cut off or cleared; nothing if somebody else has finished it.
// Throws FolderInUse
std::optional<BegunRun> beginRun(const Experiment& experiment, bool resume) {
  const std::string dir = experiment.runDir();
  requireWritable(dir);
  RunLock lock(dir);
  requireSameSettings(experiment);
  if (isFinished(experiment)) return std::nullopt;
  ResumePoint point;
  if (resume && !runStatus(dir).empty()) {
    try {
      point = findResumePoint(experiment);
    } catch (const Error&) {
      // cut off before its first checkpoint
    }
  }
  if (point.round == 0) return BegunRun{RunLog::anew(experiment, std::move(lock)), 0};
  return BegunRun{RunLog::reopen(experiment, point.rounds_done, std::move(lock)), point.round};
}

/// The runs of a sweep, worked off by several threads.
class SweepRuns {
 public:
  SweepRuns(const SweepPlan& plan, const std::vector<Experiment>& runs,
            const std::atomic<bool>& stop,
            const std::function<void(const SweepProgress&)>& on_progress)
      : resume_(plan.resume), stop_(stop), on_progress_(on_progress) {
    progress_.total = static_cast<int>(runs.size());
    for (const Experiment& run : runs) {
      if (isFinished(run)) {
        leave(run, "");
      } else {
        open_.push_back(&run);
      }
    }
  }

  /// Does runs until none is left; for each thread.
  void work() {
    for (std::size_t i = next_++; i < open_.size() && !stop_; i = next_++) {
      try {
        if (!done(*open_[i])) return;
      } catch (const std::exception& error) {
        const std::lock_guard<std::mutex> lock(mutex_);
        ++done_here_;
        failures_[i] = {open_[i]->settings().run_id, error.what()};
      }
    }
  }

  /// Once all threads have ended.
  SweepResult result(const std::string& folder) const {
    SweepResult result{folder, progress_.total, in_use_, false, {}};
    for (const auto& failure : failures_) result.failures.push_back(failure.second);
    const auto failed = static_cast<int>(failures_.size());
    result.stopped = progress_.done + in_use_ + failed < result.total;
    return result;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  // of one that is not run here: it is finished already, or somebody else writes it
  void leave(const Experiment& run, const std::string& in_use) {
    SweepProgress left = progress_;
    left.skipped = in_use.empty();
    if (left.skipped) {
      left.done = ++progress_.done;
    } else {
      ++in_use_;
    }
    left.in_use = in_use;
    left.run_id = run.settings().run_id;
    left.personal_return = left.meta_return = std::numeric_limits<double>::quiet_NaN();
    on_progress_(left);
  }

  // false if it was stopped
  bool done(const Experiment& experiment) {
    const Clock::time_point start = Clock::now();
    std::optional<BegunRun> run;
    std::string in_use;
    try {
      run = beginRun(experiment, resume_);
    } catch (const FolderInUse& held) {
      in_use = held.what();
    }
    if (!run) {
      const std::lock_guard<std::mutex> lock(mutex_);
      leave(experiment, in_use);
      return true;
    }
    const LocalResult result = runLocally(
        experiment, &run->log, [&](const RoundBook::Round&) { return !stop_; }, run->round);
    run->log.finish(result.stopped ? "stopped" : "finished");
    if (result.stopped) return false;
    std::error_code error;  // a finished run needs no checkpoints, which are most of its size
    std::filesystem::remove_all(run->log.dir() + "/checkpoint", error);
    const std::lock_guard<std::mutex> lock(mutex_);
    ++done_here_;
    ++progress_.done;
    progress_.run_id = experiment.settings().run_id;
    progress_.personal_return = result.rounds.back().summary.personal_return;
    progress_.meta_return = result.rounds.back().summary.meta_return;
    progress_.seconds = secondsSince(start);
    progress_.eta_seconds = secondsSince(begin_) / done_here_ * (progress_.total - progress_.done);
    on_progress_(progress_);
    return true;
  }

  const bool resume_;
  const std::atomic<bool>& stop_;
  const std::function<void(const SweepProgress&)>& on_progress_;
  const Clock::time_point begin_ = Clock::now();
  std::vector<const Experiment*> open_;
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;  // guards what follows
  SweepProgress progress_;
  int in_use_ = 0;
  double done_here_ = 0;
  std::map<std::size_t, SweepFailure> failures_;  // by place in open_
};

}  // namespace

SweepResult runSweep(const SweepPlan& plan, const std::atomic<bool>& stop,
                     const std::function<void(const SweepProgress&)>& on_progress) {
  const std::vector<Experiment> experiments = planSweep(plan);
  const std::string folder = experiments.front().settings().results_dir;
  requireWritable(folder);
  SweepRuns runs(plan, experiments, stop, on_progress);
  std::vector<std::thread> threads;
  for (int j = 0; j < plan.jobs; ++j) threads.emplace_back([&] { runs.work(); });
  for (std::thread& thread : threads) thread.join();
  return runs.result(folder);
}

}  // namespace pmeta
