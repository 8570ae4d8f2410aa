#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/act/evaluation.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/party.h"

namespace pmeta {

/// The one party of a run with a meta-learner: trains it on all tasks round by round, and evaluates
/// its policy on each.
///
/// A round is Experiment::stepsPerRound() transitions, worked off in whole iterations: what is made
/// beyond counts for the next round, which may then have none of its own.
///
/// One that begins in the middle of a run, without a state to load, goes on from the meta-policy:
/// it has lost its data and moments, and the costs of the rounds before, but not what was learnt.
class MetaTrainer : public Party {
 public:
  /// Throws Error unless the experiment has a meta-learner.
  explicit MetaTrainer(const Experiment& experiment);

  int number() const override { return 0; }
  std::vector<int> tasks() const override;
  bool trains() const override { return true; }
  const ModelLayout& layout() const override { return learner_->policies().layout(); }
  std::int64_t workPerRound() const override { return steps_per_round_; }
  std::optional<RoundResult> trainRound(const MetaPolicy& meta,
                                        const KeepGoing& keep_going = {}) override;
  std::vector<TaskReturn> evaluateMeta(const MetaPolicy& meta) override;
  Episode recordMeta(const MetaPolicy& meta, int task) const override;

  /// A meta-policy on a task after the most exploration that it is evaluated after, on at least
  /// `episodes` episodes that no round evaluates.
  ReturnStats evaluateFresh(const Model& policy, int task, int episodes) const;

  std::int64_t brokenEpisodes() const override { return broken_episodes_; }
  int round() const override { return round_; }
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

 private:
  // all of a run up to the end of a round
  struct Totals {
    std::vector<std::int64_t> env_steps;  // by training task
    std::int64_t updates = 0;
    std::int64_t broken_episodes = 0;
    std::vector<Loss> losses;  // of the last iteration

    std::int64_t steps() const;
    void saveState(StateWriter& writer) const;
    void loadState(StateReader& reader);
  };
  // an evaluated meta-policy, and how it got to know each task
  struct Evaluated {
    int round;
    Model model;
    std::vector<std::unique_ptr<Adaptation>> adaptations;
  };

  bool train(int round, const KeepGoing& keep_going, Totals& totals);
  void forget();
  RoundResult lastResult() const;
  std::vector<TaskReturn> evaluateTask(int task, const MetaPolicy& meta, const Model& model,
                                       std::unique_ptr<Adaptation>& adaptation);
  std::vector<int> explorationEpisodes() const;
  void addCosts(TaskReturn& result) const;
  int evaluatedBefore(int round) const;
  Rng evaluationRng(int task) const;
  template <class Work>
  auto guarded(int round, const Work& work) const;
  [[noreturn]] void fail(int round, const std::string& what, const std::string& advice) const;

  const Experiment& experiment_;
  std::string settings_hash_;
  std::uint64_t seed_;
  std::int64_t steps_per_round_;
  EvaluationSchedule evaluations_;
  std::unique_ptr<MetaLearner> learner_;
  std::vector<std::unique_ptr<Evaluation>> evaluation_;  // of each task
  int round_ = 0;                                        // trained last
  std::uint64_t iterations_ = 0;
  std::int64_t surplus_ = 0;      // steps beyond those of the rounds so far
  bool between_ = true;           // no round has been left in its middle
  std::map<int, Totals> totals_;  // of the rounds that something is still to be told of
  RoundResult last_;              // of round_, without the model
  std::int64_t broken_episodes_ = 0;
  std::optional<Evaluated> evaluated_;  // the newest
};

}  // namespace pmeta
