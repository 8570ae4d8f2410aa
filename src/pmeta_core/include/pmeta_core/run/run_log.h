#pragma once

#include <chrono>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/protocol.h"
#include "pmeta_core/run/run_lock.h"

namespace pmeta {

/// One line of rounds.csv: a return with the counters summed over the rounds so far.
struct RoundRow {
  TaskReturn result;
  std::int64_t env_steps = 0;  ///< cumulative, of the task
  std::int64_t updates = 0;    ///< cumulative, of the task
};

/// Collects returns as they arrive, in any order, and gives out complete rounds in a fixed one:
/// personal returns by task, then meta returns by task and number of context episodes. That makes a
/// run's record independent of arrival order.
class RoundBook {
 public:
  struct Round {
    RoundSummary summary;
    std::vector<RoundRow> rows;
  };

  explicit RoundBook(const Experiment& experiment);

  /// False if the return is a duplicate, of a round given out already, or of no task of this run.
  /// Throws Error if one that is due is no result: a number that is not finite, no episode, or
  /// counters that no run reaches.
  bool add(const TaskReturn& result);

  /// Round `round` has been aggregated: personal returns of its participants and of the excluded,
  /// and meta returns of all tasks are due.
  void closeRound(int round, const std::vector<int>& participants, const std::vector<int>& missing,
                  double seconds, const std::vector<int>& excluded = {});

  /// Rounds that are complete, in order; those that do not evaluate have no rows. With `force`,
  /// closed rounds come out as they are.
  std::vector<Round> take(bool force = false);

  int roundsTaken() const { return next_ - 1; }
  /// Of those rounds, the episodes that broke down.
  std::int64_t brokenEpisodes() const { return broken_episodes_; }

  /// Rounds that are open, with the returns in hand, and the counters of those given out.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);

  /// Has every training task's personal return of `round` arrived?
  bool hasPersonal(int round) const;
  /// Tasks whose returns the oldest open round still waits for.
  std::vector<int> awaited() const;

 private:
  struct Open {
    bool closed = false;
    RoundSummary summary;
    std::map<std::tuple<int, int, int>, TaskReturn> results;  ///< by policy, task, context

    bool hasPersonal(int task) const;
    bool reported(int task) const;
    bool hasMeta(int task, const std::vector<int>& contexts) const;
  };
  void requireResult(const TaskReturn& result) const;
  bool isComplete(int round, const Open& open) const;

  int num_tasks_;    ///< training tasks
  int total_tasks_;  ///< with the test tasks
  std::vector<int> contexts_;
  EvaluationSchedule evaluations_;
  int rounds_;
  bool expects_meta_;
  std::string run_id_;
  std::map<int, Open> open_;
  int next_ = 1;
  std::vector<std::int64_t> env_steps_;
  std::vector<std::int64_t> updates_;
  std::int64_t broken_episodes_ = 0;
  double seconds_ = 0;
};

/// The files of a run: config.yaml, manifest.json and rounds.csv in
/// <results_dir>/<experiment>/<run_id>, which nobody else can write until it is finished or fails.
/// A model that is not shipped is copied there too.
class RunLog {
 public:
  /// Creates the folder; throws Error if it holds a run already or cannot be written.
  explicit RunLog(const Experiment& experiment);

  /// The same for whoever has the folder in hand already: all that is in it is cleared away.
  static RunLog anew(const Experiment& experiment, RunLock lock);

  /// Goes on in the folder of an unfinished run: rounds.csv is cut back to `rounds_done` rounds,
  /// also a line that was cut off, and the manifest says "running" again. Throws Error if the run
  /// is finished, its files are not there, or somebody writes it.
  static RunLog reopen(const Experiment& experiment, int rounds_done);

  /// The same for whoever has the folder in hand already.
  static RunLog reopen(const Experiment& experiment, int rounds_done, RunLock lock);

  /// Appends the round's rows and flushes them. Throws Error, e.g. if the disk is full; rounds.csv
  /// is then as it was, and the same round can be tried again.
  void write(const RoundBook::Round& round);

  /// Waits until what has been written is on the disk.
  void sync();

  /// The last of all: sets the manifest's status, "finished" or "stopped", and lets the folder go.
  void finish(const std::string& status);

  /// Sets it to "failed" and says why, if the disk takes that: what went wrong comes first.
  void fail(const std::string& reason) noexcept;

  const std::string& dir() const { return dir_; }

  static const char* csvHeader();
  static std::string csvLine(const RoundRow& row);

 private:
  using Clock = std::chrono::steady_clock;

  RunLog(const Experiment& experiment, const std::string& started, int rounds_done, RunLock lock);
  static RunLog create(const Experiment& experiment, RunLock lock);
  void openCsv();
  void writeManifest(const std::string& status, const std::string& reason = "");

  RunLock lock_;
  std::string dir_;
  std::string manifest_;  // what does not change of it, as JSON
  int rounds_done_ = 0;
  Clock::time_point next_manifest_;  // while the run goes on
  std::int64_t broken_episodes_ = 0;
  std::ofstream csv_;
  std::uintmax_t csv_size_ = 0;  // of whole rounds
};

/// Status of a run folder: "running", "finished", "stopped", "failed", "interrupted" if its
/// manifest says that it runs but nobody writes it, or "" if it holds no run.
std::string runStatus(const std::string& run_dir);

/// What differs between the machine that the run folder's manifest names and this one, as one
/// sentence, where it changes the numbers of this experiment; "" if nothing does.
std::string otherMachine(const Experiment& experiment);

/// Throws Error unless the folder holds a run that is not finished.
void requireUnfinished(const std::string& run_dir);

/// The same, and that nobody writes.
void requireResumable(const std::string& run_dir);

/// Sets the mean returns of a round's summary from its rows; MP is after `adapted` exploration
/// episodes.
void setMeans(RoundBook::Round& round, int adapted);

/// Hands over the rows of a rounds.csv, with the lines they stand in, until `on_row` returns false.
/// A byte order mark, CRLF and blank lines do no harm, and a last line that was cut off is left
/// out. Throws Error on what no run writes.
void readRounds(const std::string& path,
                const std::function<bool(const RoundRow& row, const std::string& line)>& on_row);

/// Writes a whole file under a temporary name, then renames it: never half a file. Throws Error.
void writeFileAtomically(const std::string& path, const std::string& text);

}  // namespace pmeta
