#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "pmeta_core/base/state.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"

namespace pmeta {

/// One line of rounds.csv: a return with the counters summed over the rounds so far.
struct RoundRow {
  TaskReturn result;           ///< as it arrived
  std::int64_t env_steps = 0;  ///< cumulative, of the task
  std::int64_t updates = 0;    ///< cumulative, of the task
};

/// Collects returns as they arrive, in any order, and gives out complete rounds in a fixed one:
/// personal returns by task, then meta returns by task and number of context episodes. That makes a
/// run's record independent of arrival order.
class RoundBook {
 public:
  /// A complete round: how it went, and what there is to write of it.
  struct Round {
    RoundSummary summary;  ///< means and estimates filled in
    /// In the order of rounds.csv; none if the round does not evaluate.
    std::vector<RoundRow> rows;
  };

  /// Waits for round 1 of that experiment, whose run_id it takes.
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

  int roundsTaken() const { return next_ - 1; }  ///< how many take() has given out
  /// Of those rounds, the episodes that broke down.
  std::int64_t brokenEpisodes() const { return broken_episodes_; }

  /// Rounds that are open, with the returns in hand, and the counters of those given out.
  void saveState(StateWriter& writer) const;
  /// Refuses rounds and returns that this run does not wait for.
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

/// Sets the mean returns of a round's summary from its rows; MP is after `adapted` exploration
/// episodes.
void setMeans(RoundBook::Round& round, int adapted);

}  // namespace pmeta
