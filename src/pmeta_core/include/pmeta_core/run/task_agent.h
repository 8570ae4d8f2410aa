#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/run/divergence.h"

namespace pmeta {

/// One task's side of the algorithm: trains its personalised policy round by round. Knows no ROS.
class TaskAgent {
 public:
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
    double distance = 0;                 ///< ||phi - omega_meta|| over the task's own entries

    /// All but the update, which follows from the agent's state.
    void saveState(StateWriter& writer) const;
    /// Refuses what no round gives; `update` and `losses` stay empty.
    void loadState(StateReader& reader);
  };

  /// Called after each update with the number done in this round; false stops training.
  using KeepGoing = std::function<bool(int updates_done)>;

  /// Throws Error where Experiment::makeLearner() does.
  TaskAgent(const Experiment& experiment, int task);

  int task() const { return task_; }                       ///< a training or test task
  bool trains() const { return split_ == Split::kTrain; }  ///< a test task only evaluates
  /// Of all parameters that it takes and sends.
  const ModelLayout& layout() const { return learner_->layout(); }

  /// One round from `meta`: reset, R updates, and evaluation of the personal policy where
  /// Experiment::evaluationSchedule() has it, or `meta` asks for it. Nothing if stopped. Throws
  /// Error if the meta-policy does not fit, and TaskFailed if ten episodes running broke down, or
  /// anything of the result is not finite: nothing of it may be sent.
  ///
  /// An evaluation outside the schedule changes nothing that training or scheduled ones see.
  ///
  /// The round trained last is not trained again: asked for it once more, also after loadState(),
  /// it gives the same result. So an agent that ended between saving and sending sends what it
  /// owes.
  std::optional<RoundResult> trainRound(const MetaPolicy& meta, const KeepGoing& keep_going = {});

  /// The meta-policy on this task: one return for each of Experiment::contextEpisodes(), or none
  /// in a round that does not evaluate and where `meta` does not ask for it. Throws as trainRound()
  /// does.
  std::vector<TaskReturn> evaluateMeta(const MetaPolicy& meta);

  /// A policy on this task, on at least `episodes` episodes that no round evaluates; a meta-policy
  /// after the most exploration episodes it is evaluated after.
  ReturnStats evaluateFresh(PolicyKind kind, const Model& policy, int episodes) const;

  /// phi as the last round left it, with the task's presence mask.
  const Model& personal() const { return learner_->personal(); }
  /// What tells the personal policy its task beside the observations; empty if nothing does.
  std::vector<float> taskInput() const { return learner_->taskInput(learner_->personal()); }

  /// Episodes that broke down so far, in training and in the evaluations of rounds.
  std::int64_t brokenEpisodes() const { return broken_episodes_; }

  /// The round trained last; 0 before the first.
  int round() const { return round_; }

  /// All that its later rounds depend on: of the learner, counters, weight, and the last result. To
  /// be called between two rounds, where no generator is alive; throws Error after a round that was
  /// stopped, or for a test task, which has no state.
  void saveState(StateWriter& writer) const;
  /// Refuses the state of another task or of a round beyond the run's last; throws Error for a test
  /// task.
  void loadState(StateReader& reader);

  /// One greedy episode, from the same start whatever the policy and round.
  Episode recordPersonal() const;
  /// The first episode behind the last return that evaluateMeta() gave of this meta-policy: after
  /// the most exploration. Throws Error if the last call was of another round's, or none.
  Episode recordMeta(const MetaPolicy& meta) const;

 private:
  bool train(int round, const KeepGoing& keep_going, RoundResult& result);
  RoundResult lastResult() const;
  const Model& sent() const;
  void adjustWeight(double personal_return);
  Rng evaluationRng() const;
  TaskReturn makeReturn(int round, PolicyKind policy, const ReturnStats& stats);
  template <class Work>
  auto guarded(int round, const Work& work) const;
  [[noreturn]] void fail(int round, const std::string& what, const std::string& advice) const;

  std::string run_id_;
  std::string settings_hash_;
  std::string name_;                 // for people
  std::string step_sizes_;           // what to change where it diverges
  std::string simulation_settings_;  // and where its simulation breaks down
  std::uint64_t seed_;
  int task_;
  Split split_;
  int updates_per_round_;
  bool keeps_personal_;
  bool sends_personal_;
  EvaluationSchedule evaluations_;
  int round_ = 0;               // trained last
  RoundResult last_;            // of that round, without the model, which the learner has
  bool between_ = true;         // no round has been left in its middle
  std::int64_t env_steps_ = 0;  // since the last evaluation
  std::int64_t updates_ = 0;
  std::int64_t unreported_broken_ = 0;  // training episodes that broke down, likewise
  std::int64_t broken_episodes_ = 0;    // in all
  double catch_up_;
  double log_weight_ = 0;              // of this task's updates in the mean
  std::optional<double> meta_return_;  // the newest scheduled one on this task
  AdaptedReturn adapted_;              // of the newest evaluation of a meta-policy,
  int adapted_round_ = -1;             // which was this round's
  std::unique_ptr<PersonalLearner> learner_;
};

}  // namespace pmeta
