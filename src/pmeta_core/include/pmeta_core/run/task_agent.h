#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/run/divergence.h"
#include "pmeta_core/run/party.h"
#include "pmeta_core/storage/best_policy.h"

namespace pmeta {

/// One task's side of the algorithm: trains its personalised policy round by round.
class TaskAgent : public Party {
 public:
  /// Throws Error where Experiment::makeLearner() does.
  TaskAgent(const Experiment& experiment, int task);

  int task() const { return task_; }  ///< a training or test task
  int number() const override { return task_; }
  std::vector<int> tasks() const override { return {task_}; }
  bool trains() const override { return split_ == Split::kTrain; }  ///< a test task only evaluates
  const ModelLayout& layout() const override { return learner_->layout(); }
  std::int64_t workPerRound() const override { return updates_per_round_; }

  /// One round from `meta`: reset, R updates, and evaluation of the personal policy where
  /// Experiment::evaluationSchedule() has it, or `meta` asks for it; an evaluation outside the
  /// schedule changes nothing that training or scheduled ones see.
  std::optional<RoundResult> trainRound(const MetaPolicy& meta,
                                        const KeepGoing& keep_going = {}) override;

  std::vector<TaskReturn> evaluateMeta(const MetaPolicy& meta) override;
  Episode recordMeta(const MetaPolicy& meta, int task) const override;

  /// A policy on this task, on at least `episodes` episodes that no round evaluates; a meta-policy
  /// after the most exploration episodes it is evaluated after.
  ReturnStats evaluateFresh(PolicyKind kind, const Model& policy, int episodes) const;

  /// phi as the last round left it, with the task's presence mask.
  const Model& personal() const { return learner_->personal(); }
  /// What tells the personal policy its task beside the observations; empty if nothing does.
  std::vector<float> taskInput() const { return learner_->taskInput(learner_->personal()); }

  std::int64_t brokenEpisodes() const override { return broken_episodes_; }
  int round() const override { return round_; }
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;
  std::optional<Episode> recordPersonal() const override;
  void savePersonal(const Experiment& experiment, int round) const override;
  void keepBest(const Experiment& experiment) override;

 private:
  bool train(int round, const KeepGoing& keep_going, RoundResult& result);
  RoundResult lastResult() const;
  const Model& sent() const;
  PolicyOrigin personalOrigin(int round) const;
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
  BestPolicy best_;  // of its personal ones
};

}  // namespace pmeta
