#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {

/// What a run says on a console: a line a round, and a table of all tasks at its end. Gives text
/// only; whoever has the console prints it.
class RunConsole {
 public:
  /// terminal: somebody watches. Then every evaluated round has a line, with a bar; else there are
  /// ten lines spread over the run, and no bar. Either way, ten seconds of rounds without a line
  /// bring one.
  RunConsole(const Experiment& experiment, bool terminal);

  /// Takes a round's record and gives its line without a newline: round, PP, MP, return on test
  /// tasks, environment steps a second since the last evaluated round, and the time left; of a
  /// round that is not evaluated, the first and the last of these. "" if none is due. Rounds come
  /// in order.
  std::string take(const RoundBook::Round& round);

  /// Takes the rounds that a run has behind it when it goes on, from its rounds.csv; nothing is
  /// said of them but in the table. Throws Error if the file is altered.
  void recall(const std::string& rounds_csv);

  /// PP and MP of every task and their means: of the last evaluated round, and the best with its
  /// round; test tasks have no PP. MP is after adaptation. Lines, each with a newline; "" before
  /// the first evaluated round.
  std::string table() const;

 private:
  /// The returns of one policy on one task, or a mean over tasks, round by round.
  struct Course {
    double last = std::numeric_limits<double>::quiet_NaN();
    double best = std::numeric_limits<double>::quiet_NaN();
    int best_round = 0;

    void add(double value, int round);
  };
  struct Courses {
    Course personal;
    Course meta;
  };

  void takeRows(const RoundBook::Round& round);
  bool isDue(const RoundBook::Round& round) const;
  std::string tableLine(const std::string& name, const Courses& courses, std::size_t width) const;

  std::vector<std::string> names_;  ///< by task
  int num_tasks_;                   ///< training tasks
  bool has_personal_;               // policies: none with a meta-learner
  int rounds_;
  int adapted_;  ///< exploration episodes behind MP
  bool terminal_;
  std::vector<Courses> tasks_;
  Courses means_;  ///< PP and MP
  Course test_;    ///< the mean over test tasks
  bool evaluated_ = false;
  int printed_tenths_ = 0;
  double seconds_ = 0;      ///< of the rounds since the last evaluated one
  double silence_ = 0;      ///< seconds of the rounds since the last line
  std::int64_t steps_ = 0;  ///< of all tasks since then
  std::vector<std::int64_t> cumulative_steps_;
};

/// "[=====>    ]": `done` of `all` as a bar of `width` cells.
std::string progressBar(int done, int all, int width);

/// What a run folder holds: its path, and its files and folders with their sizes or numbers of
/// files. Lines, each with a newline.
std::string listRunFolder(const std::string& dir);

}  // namespace pmeta
