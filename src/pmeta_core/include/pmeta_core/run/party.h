#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/learn/learner.h"
#include "pmeta_core/messages/protocol.h"

namespace pmeta {

/// What one round of training gives.
struct RoundResult {
  AuxiliaryUpdate update;              ///< to be sent
  std::optional<TaskReturn> personal;  ///< in rounds that evaluate; counts all since the last
                                       ///< scheduled one
  std::int64_t env_steps = 0;          ///< of this round
  std::int64_t updates = 0;            ///< of this round
  double loss = 0;                     ///< of the last update
  std::vector<Loss> losses;            ///< all there are of it; none after loadState()
  std::int64_t broken_episodes = 0;    ///< of this round's training
  double distance = 0;                 ///< from what was learnt to the meta-policy before

  /// All but the update, which follows from the party's state.
  void saveState(StateWriter& writer) const;
  /// Refuses what no round gives; `update` and `losses` stay empty.
  void loadState(StateReader& reader);
};

/// Who trains in a run's rounds: one task's agent, or the meta-learner of all tasks. Knows no ROS.
class Party {
 public:
  /// Called with how much of this round is done; false stops training.
  using KeepGoing = std::function<bool(std::int64_t done)>;

  virtual ~Party() = default;

  /// Its number among those that send updates, in those and in names of checkpoints: an agent's
  /// task, or 0.
  virtual int number() const = 0;

  /// The tasks that it evaluates meta-policies on, ascending.
  virtual std::vector<int> tasks() const = 0;

  virtual bool trains() const = 0;  ///< or does it only evaluate?
  /// Of all parameters that it takes and sends.
  virtual const ModelLayout& layout() const = 0;

  /// What KeepGoing counts up to in a round: updates of an agent, steps of a meta-learner.
  virtual std::int64_t workPerRound() const = 0;

  /// One round from `meta`. Nothing if stopped. Throws Error if the meta-policy does not fit, and
  /// TaskFailed if ten episodes running broke down, or anything of the result is not finite:
  /// nothing of it may be sent.
  ///
  /// The round trained last is not trained again: asked for it once more, also after loadState(),
  /// it gives the same result. So whoever ended between saving and sending sends what is owed.
  virtual std::optional<RoundResult> trainRound(const MetaPolicy& meta,
                                                const KeepGoing& keep_going = {}) = 0;

  /// The meta-policy on its tasks: one return for each and each of Experiment::contextEpisodes(),
  /// or none in a round that does not evaluate and where `meta` does not ask for it. Throws as
  /// trainRound() does.
  virtual std::vector<TaskReturn> evaluateMeta(const MetaPolicy& meta) = 0;

  /// The first episode behind the last return on `task` that evaluateMeta() gave of this
  /// meta-policy: after the most exploration. Throws Error if the last call was of another round's,
  /// or none.
  virtual Episode recordMeta(const MetaPolicy& meta, int task) const = 0;

  /// One greedy episode of its personal policy, from the same start whatever the policy and round;
  /// nothing where there is none.
  virtual std::optional<Episode> recordPersonal() const { return std::nullopt; }

  /// Writes its personal policy after `round`, where it has one, below policies/ of the run folder.
  /// Throws Error, e.g. if the disk is full.
  virtual void savePersonal(const Experiment& experiment, int round) const;

  /// Keeps its personal policy as BestPolicy does, if the round trained last has evaluated it by
  /// the schedule, and where it has one. Throws Error, e.g. if the disk is full.
  virtual void keepBest(const Experiment& experiment);

  /// Episodes that broke down so far, in training and in the evaluations of rounds.
  virtual std::int64_t brokenEpisodes() const = 0;

  /// The round trained last; 0 before the first.
  virtual int round() const = 0;

  /// All that its later rounds depend on. To be called between two rounds, where no generator is
  /// alive; throws Error after a round that was stopped, or where there is no state.
  virtual void saveState(StateWriter& writer) const = 0;
  /// Refuses the state of another party, or of a round beyond the run's last.
  virtual void loadState(StateReader& reader) = 0;
};

/// What `evaluate` gives with generators that no round evaluates with, once and again until there
/// are `episodes` of it, taken together.
ReturnStats overFreshEpisodes(std::uint64_t seed, int task, int episodes,
                              const std::function<ReturnStats(Rng& rng)>& evaluate);

/// Throws Error, which says that this meta-policy has not been evaluated.
[[noreturn]] void refuseUnevaluated(const MetaPolicy& meta);

}  // namespace pmeta
