#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/storage/round_book.h"
#include "pmeta_core/storage/run_lock.h"
#include "pmeta_core/storage/table_file.h"

namespace pmeta {

/// The files of a run: config.yaml, manifest.json, rounds.csv and losses.csv (of each evaluated
/// round, all that every learner measured at its last update) in RESULTS_DIR/EXPERIMENT/RUN_ID,
/// which nobody else can write until it is finished or fails. A model that is not shipped is copied
/// there too.
class RunLog {
 public:
  /// Creates the folder; throws Error if it holds a run already or cannot be written.
  explicit RunLog(const Experiment& experiment);

  /// The same for whoever has the folder in hand already: all that is in it is cleared away.
  static RunLog anew(const Experiment& experiment, RunLock lock);

  /// Goes on in the folder of an unfinished run: both tables are cut back to `rounds_done` rounds,
  /// also a line that was cut off, and the manifest says "running" again. Throws Error if the run
  /// is finished, its files are not there, or somebody writes it.
  static RunLog reopen(const Experiment& experiment, int rounds_done);

  /// The same for whoever has the folder in hand already.
  static RunLog reopen(const Experiment& experiment, int rounds_done, RunLock lock);

  /// Appends the round's rows and flushes them. Throws Error, e.g. if the disk is full; both tables
  /// are then as they were, and the same round can be tried again.
  void write(const RoundBook::Round& round);

  /// Waits until what has been written is on the disk.
  void sync();

  /// The last of all: sets the manifest's status, "finished" or "stopped", and lets the folder go.
  void finish(const std::string& status);

  /// Sets it to "failed" and says why, if the disk takes that: what went wrong comes first.
  void fail(const std::string& reason) noexcept;

  const std::string& dir() const { return dir_; }  ///< the run folder

  static const char* csvHeader();  ///< of rounds.csv, without a newline
  /// A row of rounds.csv, without a newline; numbers read back as they were, but `wall_s`.
  static std::string csvLine(const RoundRow& row);
  /// A row of losses.csv for each loss of a return, with a newline each.
  static std::string lossLines(const TaskReturn& result);

 private:
  using Clock = std::chrono::steady_clock;

  RunLog(const Experiment& experiment, const std::string& started, int rounds_done, RunLock lock);
  static RunLog create(const Experiment& experiment, RunLock lock);
  void openTables();
  void writeManifest(const std::string& status, const std::string& reason = "");

  RunLock lock_;
  std::string dir_;
  std::string manifest_;  // what does not change of it, as JSON
  int rounds_done_ = 0;
  Clock::time_point next_manifest_;  // while the run goes on
  std::int64_t broken_episodes_ = 0;
  std::optional<TableFile> rounds_, losses_;
};

/// Status of a run folder: "running", "finished", "stopped", "failed", "interrupted" if its
/// manifest says that it runs but nobody writes it, or "" if it holds no run.
std::string runStatus(const std::string& run_dir);

/// Throws Error unless the folder holds a run that is not finished.
void requireUnfinished(const std::string& run_dir);

/// The same, and that nobody writes.
void requireResumable(const std::string& run_dir);

/// Hands over the rows of a rounds.csv, with the lines they stand in, until `on_row` returns false.
/// A byte order mark, CRLF and blank lines do no harm, and a last line that was cut off is left
/// out. Throws Error on what no run writes.
void readRounds(const std::string& path,
                const std::function<bool(const RoundRow& row, const std::string& line)>& on_row);

/// Writes a whole file under a temporary name, then renames it: never half a file. Throws Error.
void writeFileAtomically(const std::string& path, const std::string& text);

}  // namespace pmeta
