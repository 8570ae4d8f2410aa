#pragma once

#include <limits>
#include <string>
#include <vector>

#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/run/task_agent.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {

/// One line of final.csv: a kept policy on one task, on episodes that chose nothing.
struct FreshReturn {
  std::string snapshot;                       ///< "last", "best" or "own_best"
  int round = 0;                              ///< the round it is from
  PolicyKind policy = PolicyKind::kPersonal;  ///< meta: after the most exploration episodes
  int trained_task = -1;                      ///< whose personal policy; -1 for the meta-policy
  int task = 0;                               ///< where it is evaluated
  Split split = Split::kTrain;                ///< of `task`
  ReturnStats stats;                          ///< over the fresh episodes
};

/// Keeps the policies of the last and of the best round, and evaluates them on fresh episodes.
///
/// The best round of a run is a maximum over noisy evaluations, so its return is biased upwards;
/// the same policies on fresh episodes are not. Personal policies compete by their mean over tasks
/// (PP), meta-policies by theirs (MP). "own_best" is what robots can do by themselves: each keeps
/// its personal policy of the round in which it did best on its own task.
class FreshEvaluation {
 public:
  /// A round is complete: its record, the agents as they are (training tasks first), and the
  /// meta-policy it gave.
  void offer(const RoundBook::Round& round, const std::vector<TaskAgent>& agents,
             const MetaPolicy& meta);

  /// Every kept policy on at least `episodes` episodes a task. `cross`: personal policies on the
  /// other tasks too.
  std::vector<FreshReturn> evaluate(const std::vector<TaskAgent>& agents, int episodes,
                                    bool cross) const;

  /// The policies kept so far. Loading needs the agents, in the same order.
  void saveState(StateWriter& writer) const;
  /// Refuses models that do not fit the agents.
  void loadState(StateReader& reader, const std::vector<TaskAgent>& agents);

  /// The rows as CSV, with a header.
  static std::string csv(const std::vector<FreshReturn>& rows);

 private:
  struct Kept {
    int round = 0;
    double value = -std::numeric_limits<double>::infinity();
    std::vector<Model> models;

    void saveState(StateWriter& writer) const;
  };
  static Kept load(StateReader& reader, const std::string& name, const std::vector<Model>& like);
  Kept last_personal_, best_personal_, last_meta_, best_meta_;
  std::vector<Kept> own_best_;  ///< by training task
};

}  // namespace pmeta
