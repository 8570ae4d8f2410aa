#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/aggregate/norm_bound.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"

namespace pmeta {

/// The aggregator's side of the algorithm: collects one update a task and mixes them. Knows no ROS.
class MetaAggregator {
 public:
  /// What becomes of an update that is offered.
  enum class Verdict {
    kAccepted,   ///< kept for this round
    kDuplicate,  ///< this task has already reported in this round
    kStale,      ///< of a round that is over
    kRefused,    ///< does not belong here; Answer::reason says why
  };
  /// What offer() says of an update.
  struct Answer {
    Verdict verdict = Verdict::kAccepted;  ///< accepted, or why not
    std::string reason;  ///< a sentence or clause for people; "" if it is accepted
  };
  /// How often each verdict was given to a task.
  struct Counts {
    std::int64_t accepted = 0;   ///< kept for a round
    std::int64_t duplicate = 0;  ///< a second one in a round
    std::int64_t stale = 0;      ///< of rounds that were over
    std::int64_t refused = 0;    ///< that did not belong to the run
    std::int64_t excluded = 0;   ///< of those accepted: left out when the round was closed
    std::string last_reason;     ///< of the newest update that was refused or left out; "" if none
  };
  /// An update that came but was left out of an aggregation.
  struct Exclusion {
    int task = 0;        ///< whose update it was
    std::string reason;  ///< a clause: "its distance to the meta-policy, 812, is above ..."
  };

  /// Begins with the initial meta-policy of that experiment, as round 0.
  explicit MetaAggregator(const Experiment& experiment);

  /// Checks an update and keeps it for this round. The update is shared, not copied.
  Answer offer(std::shared_ptr<const AuxiliaryUpdate> update);

  /// A task has failed for good, as TaskFailed says: it sends nothing more. False if that is known.
  bool giveUp(int task, const std::string& reason);

  /// Why the run cannot go on: the sentence of the first task that failed. "" while it can: nobody
  /// has failed, or tasks enough for a quorum of fewer than all are left.
  std::string hopeless() const;

  /// The meta-policy after the rounds closed so far.
  const MetaPolicy& metaPolicy() const { return meta_; }

  /// What is to go out with it.
  void ask(bool evaluate, bool checkpoint);

  int expected() const { return static_cast<int>(updates_.size()); }  ///< updates of a full round
  int quorum() const { return quorum_; }                              ///< that suffice once late
  std::vector<int> reported() const;                                  ///< tasks in, ascending
  std::vector<int> missing() const;                    ///< tasks still out, ascending
  bool complete() const { return missing().empty(); }  ///< have all tasks reported?
  /// Would what is in suffice for a late round?
  bool hasQuorum() const { return static_cast<int>(reported().size()) >= quorum_; }

  /// Mixes what has been reported, in task order, without what the settings' NormBound objects to,
  /// and begins the next round; if nothing is left the meta-policy stays as it is.
  /// Returns the tasks that were missing. Needs at least one update.
  std::vector<int> closeRound();

  /// Whom the last closed round left out, in task order.
  const std::vector<Exclusion>& exclusions() const { return exclusions_; }
  std::vector<int> excluded() const;  ///< their tasks

  /// Counts an update that could not even be offered; `task` is whose it claims to be.
  void countRefusal(int task, const std::string& reason);

  /// Meta-policy, round, participants and counts; what has been reported for the open round is left
  /// out: agents send it again.
  void saveState(StateWriter& writer) const;
  /// Refuses another number of tasks or rounds than the experiment has.
  void loadState(StateReader& reader);

  const std::vector<Counts>& counts() const { return counts_; }     ///< by task
  std::int64_t refusedUnknown() const { return refused_unknown_; }  ///< from tasks not of this run

 private:
  std::string refusal(const AuxiliaryUpdate& update) const;
  std::vector<Exclusion> findExclusions() const;

  int rounds_;
  AggregationSettings settings_;
  std::shared_ptr<const AggregationRule> rule_;
  NormBound bound_;
  int quorum_;
  MetaPolicy meta_;
  std::vector<std::shared_ptr<const AuxiliaryUpdate>> updates_;  ///< by task; null: missing
  std::vector<double> norms_;  ///< of the updates, by task, where bound_ asks for them
  std::vector<Exclusion> exclusions_;
  std::vector<Counts> counts_;
  std::map<int, std::string> failures_;  ///< by task; a test task may be among them
  std::int64_t refused_unknown_ = 0;
};

}  // namespace pmeta
