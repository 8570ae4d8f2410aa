#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/act/q_policies.h"
#include "pmeta_core/act/rollout.h"
#include "pmeta_core/learn/dqn_update.h"
#include "pmeta_core/learn/epsilon_schedule.h"
#include "pmeta_core/learn/learner.h"
#include "pmeta_core/replay/n_step.h"
#include "pmeta_core/replay/prioritised_replay.h"

namespace pmeta {

/// Deep Q-learning on one task with discrete actions: DqnUpdate on batches of the replay, where
/// epsilon-greedy steps in several environments are kept.
class DqnLearner : public Learner, private Actor {
 public:
  /// `envs`: those to train in, at least one (settings.num_envs is for who makes them).
  /// `total_updates`: of the whole run, for the exploration rate. Throws Error if actions are
  /// continuous or the warm-up is too short.
  DqnLearner(std::vector<std::unique_ptr<Env>> envs, const DqnSettings& settings,
             std::int64_t total_updates);

  /// The network of action values, whose parameters are learnt.
  const Mlp& network() const { return policies_.network(); }

  /// Makes every target network a copy of `parameters`; to be called before the first update.
  void resetTargets(const float* parameters) { update_.resetTargets(parameters); }

  /// env_steps_per_update epsilon-greedy steps in each environment, kept in the replay; the first
  /// call also starts the environments and warms them up. Of an episode that breaks down or is
  /// interrupted, the last steps, which still wait for rewards, are dropped. Returns the
  /// transitions made.
  std::int64_t collect(const float* parameters, Rng& rng);

  /// One batch from the replay, see DqnUpdate; then sets new priorities. Returns the loss.
  /// Allocates nothing after the first call.
  double update(const float* parameters, Optimizer<float>& optimizer, Rng& rng);

  const PolicyFamily& policies() const override { return policies_; }
  Model blank() const override { return Model(policies_.layout()); }
  /// The first meta-policy is also the first target network.
  void beginRound(const Model& meta, bool first) override;
  UpdateStats learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) override;
  const std::vector<Loss>& losses() const override { return losses_; }
  std::vector<float> taskInput(const Model&) const override { return {}; }
  std::optional<ReturnStats> exactReturn(const Model&) const override { return std::nullopt; }
  void addValues(const Model&, const std::vector<float>&, Episode&) const override {}

  std::int64_t updates() const { return update_.updates(); }  ///< calls of update() so far
  /// Exploration rate of the next update.
  double epsilon() const { return schedule_.at(updates()); }
  /// Transitions of n steps, warm-up included.
  const PrioritisedReplay& replay() const { return replay_; }
  /// Parameters of the target networks, one by one.
  const AlignedFloats& targets() const { return update_.targets(); }
  std::size_t numEnvs() const { return rollout_.size(); }  ///< stepped side by side
  /// One of those, as training has left it.
  const Env& env(std::size_t i) const { return rollout_.env(i); }

  void saveState(StateWriter& writer) const override;
  /// Refuses what is no action of this task, and an empty replay after the warm-up.
  void loadState(StateReader& reader) override;

 private:
  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;
  bool isAction(float action) const;
  std::vector<std::string> envNames() const;

  DqnSettings settings_;
  QPolicies policies_;
  Rollout rollout_;
  EpsilonSchedule schedule_;
  QActor acting_;
  PrioritisedReplay replay_;
  NStepAccumulator n_step_;
  DqnUpdate update_;
  ReplayBatch batch_;
  bool started_ = false;
  double epsilon_ = 1;  // of the steps at hand
  std::vector<Loss> losses_ = {{"td", 0}};
};

}  // namespace pmeta
