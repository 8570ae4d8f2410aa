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

}  // namespace

SweepResult runSweep(const SweepPlan& plan, const std::atomic<bool>& stop,
                     const std::function<void(const SweepProgress&)>& on_progress) {
  const std::vector<Experiment> runs = planSweep(plan);
  const std::string folder = runs.front().settings().results_dir;
  requireWritable(folder);

  std::vector<const Experiment*> open;
  SweepProgress progress;
  progress.total = static_cast<int>(runs.size());
  SweepResult result{folder, progress.total, 0, false, {}};
  // of one that is not run here: it is finished already, or somebody else writes it
  const auto leave = [&](const Experiment& run, const std::string& in_use) {
    SweepProgress left = progress;
    left.skipped = in_use.empty();
    if (left.skipped) {
      left.done = ++progress.done;
    } else {
      ++result.in_use;
    }
    left.in_use = in_use;
    left.run_id = run.settings().run_id;
    left.personal_return = left.meta_return = std::numeric_limits<double>::quiet_NaN();
    on_progress(left);
  };
  for (const Experiment& run : runs) {
    if (isFinished(run)) {
      leave(run, "");
    } else {
      open.push_back(&run);
    }
  }

  using Clock = std::chrono::steady_clock;
  const auto secondsSince = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  const Clock::time_point begin = Clock::now();
  std::mutex mutex;
  std::atomic<std::size_t> next{0};
  double done_here = 0;
  std::map<std::size_t, SweepFailure> failures;  // by place in `open`
  const auto work = [&] {
    for (std::size_t i = next++; i < open.size() && !stop; i = next++) {
      const Clock::time_point start = Clock::now();
      try {
        std::optional<BegunRun> run;
        std::string in_use;
        try {
          run = beginRun(*open[i], plan.resume);
        } catch (const FolderInUse& held) {
          in_use = held.what();
        }
        if (!run) {
          const std::lock_guard<std::mutex> lock(mutex);
          leave(*open[i], in_use);
          continue;
        }
        const LocalResult ended = runLocally(
            *open[i], &run->log, [&](const RoundBook::Round&) { return !stop; }, run->round);
        run->log.finish(ended.stopped ? "stopped" : "finished");
        if (ended.stopped) return;
        std::error_code error;  // a finished run needs no checkpoints, which are most of its size
        std::filesystem::remove_all(run->log.dir() + "/checkpoint", error);
        const std::lock_guard<std::mutex> lock(mutex);
        ++done_here;
        ++progress.done;
        progress.run_id = open[i]->settings().run_id;
        progress.personal_return = ended.rounds.back().summary.personal_return;
        progress.meta_return = ended.rounds.back().summary.meta_return;
        progress.seconds = secondsSince(start);
        progress.eta_seconds = secondsSince(begin) / done_here * (runs.size() - progress.done);
        on_progress(progress);
      } catch (const std::exception& error) {
        const std::lock_guard<std::mutex> lock(mutex);
        ++done_here;
        failures[i] = {open[i]->settings().run_id, error.what()};
      }
    }
  };
  std::vector<std::thread> threads;
  for (int j = 0; j < plan.jobs; ++j) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  for (auto& [place, failure] : failures) result.failures.push_back(std::move(failure));
  const auto failed = static_cast<int>(failures.size());
  result.stopped = progress.done + result.in_use + failed < result.total;
  return result;
}

}  // namespace pmeta
