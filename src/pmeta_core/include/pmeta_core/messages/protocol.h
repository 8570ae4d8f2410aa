#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/state.h"
#include "pmeta_core/learn/loss.h"

namespace pmeta {

/// What the aggregator publishes: the meta-policy after `round` aggregations (0: the initial one).
struct MetaPolicy {
  std::string run_id;             ///< of the run that it belongs to
  int round = 0;                  ///< aggregations behind it
  Model model;                    ///< omega_meta, all entries present
  std::vector<int> participants;  ///< tasks in this aggregation, ascending; empty for round 0
  bool evaluate = false;  ///< somebody wants this and the personal policies after it evaluated
  std::uint64_t incarnation = 0;  ///< of the aggregator; one started again may go back to a round
  bool checkpoint = false;        ///< all are to save one after the round that begins with this
  std::string settings_hash;      ///< Experiment::settingsHash() of the aggregator
};

/// What an agent sends at the end of its round: auxiliary (or, when averaging, personal)
/// parameters.
struct AuxiliaryUpdate {
  std::string run_id;  ///< of the run that it belongs to
  int task = 0;        ///< a training task
  int round = 0;       ///< the round that was trained: one more than the meta-policy it began with
  Model model;         ///< with the task's presence mask
  /// Positive: how much it counts in the mean, see AggregationSettings::catch_up.
  double weight = 1;
  std::string settings_hash;  ///< Experiment::settingsHash() of the agent
};

/// The state of losses: their names and values.
void saveLosses(StateWriter& writer, const std::vector<Loss>& losses);
/// Refuses losses without names, or too many of them.
std::vector<Loss> readLosses(StateReader& reader);

/// Whose parameters a policy has.
enum class PolicyKind { kPersonal, kMeta };
/// Was the task trained on, or held out for the meta-policy?
enum class Split { kTrain, kTest };

const char* name(PolicyKind policy);  ///< "personal", "meta"
const char* name(Split split);        ///< "train", "test"

constexpr std::size_t kMostLosses = 100;       ///< of one learner
constexpr std::size_t kLongestLossName = 100;  ///< in bytes

/// Result of one evaluation of one policy on one task.
struct TaskReturn {
  std::string run_id;  ///< of the run that it belongs to
  int task = 0;        ///< a training or test task
  int round = 0;  ///< personal: after this round's training; meta: after this round's aggregation
  bool scheduled = true;        ///< false: somebody asked for it; in no table, only to be looked at
  Split split = Split::kTrain;  ///< of `task`
  /// PP is made of personal returns, MP of the meta-policy's.
  PolicyKind policy = PolicyKind::kPersonal;
  int context_episodes = 0;  ///< meta-policy: exploration episodes that it has adapted from
  double mean = 0;           ///< mean undiscounted return
  double std = 0;            ///< over episodes
  int episodes = 0;          ///< of the mean; start states where it is exact
  /// Training transitions since the last return: personal, or with a meta-learner the meta-policy's
  /// before exploration; else 0.
  std::int64_t env_steps = 0;
  std::int64_t updates = 0;  ///< of the policy, likewise
  /// Episodes whose simulation broke down: of the evaluation, and of training since the last.
  std::int64_t broken_episodes = 0;
  double seconds = 0;  ///< wall time of this round's training and evaluation
  /// All that the learner measured at the last update, see Learner::losses(); with a meta-learner
  /// in the return of task 0 that has its costs. Else none.
  std::vector<Loss> losses;

  /// All but run_id, which whoever loads it knows.
  void saveState(StateWriter& writer) const;
  /// Refuses counts that no run reaches, and losses without names.
  void loadState(StateReader& reader);
};

/// One round as the aggregator saw it.
struct RoundSummary {
  std::string run_id;          ///< of the run that it belongs to
  int round = 0;               ///< 1 to `rounds`
  int rounds = 0;              ///< C
  double personal_return = 0;  ///< PP: mean over reported training tasks; NaN if none
  double meta_return = 0;      ///< MP: the same, after adaptation; NaN if none
  double test_return = 0;      ///< of the meta-policy on test tasks, after adaptation; NaN if none
  std::vector<int> participants;  ///< tasks whose update was mixed in, ascending
  std::vector<int> missing;       ///< tasks whose update this round did without
  std::vector<int> excluded;      ///< tasks whose update came but was left out of the aggregation
  double seconds = 0;             ///< from the meta-policy's publication to the aggregation
  double eta_seconds = 0;         ///< estimate until the last round
  std::int64_t broken_episodes = 0;  ///< of all rounds so far

  /// What is known when the round closes: round, participants, missing, excluded and seconds.
  void saveState(StateWriter& writer) const;
  /// Refuses tasks that are not ascending, and rounds that no run reaches.
  void loadState(StateReader& reader);
};

/// Says that `who` has other settings than this party: a sentence.
std::string otherSettings(const std::string& who, const std::string& theirs,
                          const std::string& ours);

}  // namespace pmeta
