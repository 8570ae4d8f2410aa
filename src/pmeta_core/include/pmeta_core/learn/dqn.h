#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/epsilon_schedule.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/replay/n_step.h"
#include "pmeta_core/replay/prioritised_replay.h"

namespace pmeta {

/// Settings of deep Q-learning.
struct DqnSettings {
  std::vector<int> hidden = {512, 512};  ///< units of each hidden layer
  int batch_size = 64;                   ///< transitions of one update
  int buffer_size = 200000;              ///< transitions the replay holds
  double gamma = 0.99;                   ///< discount
  int n_step = 3;                        ///< rewards summed before bootstrapping
  bool double_q = false;                 ///< the online network chooses the action of the target
  bool dueling = false;                  ///< state value and advantages apart
  bool huber = false;                    ///< Huber loss with threshold 1 instead of the square
  int target_update_interval = 350;      ///< updates between copies to the target network
  int averaged_targets = 1;              ///< target networks whose mean is the target; 1: plain DQN
  double epsilon_start = 0.3;            ///< exploration rate at the first update
  double epsilon_finish = 0.01;          ///< exploration rate at the end of its slope
  double epsilon_fraction = 1;           ///< length of the slope as a share of all updates
  int num_envs = 10;                     ///< environments stepped in parallel
  int env_steps_per_update = 1;          ///< steps in each environment before an update
  int warm_up_steps = 64;                ///< random steps in each environment before the first
  bool bootstrap_at_limit = true;        ///< the horizon is no terminal state to the target
  double priority_alpha = 0.6;           ///< how far priorities count; 0: uniform replay
  double priority_beta = 0.4;            ///< how far importance weights correct for that
  int evaluation_episodes = 10;          ///< greedy episodes of one evaluation
  bool portable = false;                 ///< see MlpSpec; set by the experiment's `arithmetic`
};

/// Binds all of them below `prefix`, e.g. "dqn.".
void bind(Settings& settings, const std::string& prefix, DqnSettings& dqn);

/// The Q-network that DqnLearner trains. Throws Error if actions are continuous.
MlpSpec dqnNetwork(const EnvSpec& env, const DqnSettings& settings);

/// Deep Q-learning on one task with discrete actions: environments, replay and target networks.
///
/// The parameters belong to the caller: it passes them in, and an optimiser that moves them.
/// Target of a sample, with the mean Q_bar of the last K target networks
/// (K = 1: Mnih et al., Nature 2015; K > 1: averaged DQN, Anschel et al., ICML 2017):
///
///     y = R_n + discount * max_a Q_bar(s_n, a)
///     y = R_n + discount * Q_bar(s_n, argmax_a Q(s_n, a))    double_q (van Hasselt et al., 2016)
///
/// Loss: mean over the batch of w_b (Q(s_b, a_b) - y_b)^2, or w_b Huber(Q(s_b, a_b) - y_b), with
/// the importance weights w_b of the replay. Neither targets nor weights carry gradients.
class DqnLearner {
 public:
  /// `envs`: copies of one task, at least one (settings.num_envs is for who makes them).
  /// `total_updates`: of the whole run, for the exploration rate. Throws Error if actions are
  /// continuous or the warm-up is too short.
  DqnLearner(std::vector<std::unique_ptr<Env>> envs, const DqnSettings& settings,
             std::int64_t total_updates);

  const Mlp& network() const { return network_; }

  /// Makes every target network a copy of `parameters`; to be called before the first update.
  void resetTargets(const float* parameters);

  /// env_steps_per_update epsilon-greedy steps in each environment, kept in the replay; the first
  /// call also starts the environments and warms them up. Returns the transitions made.
  std::int64_t collect(const float* parameters, Rng& rng);

  /// One batch from the replay: hands the loss's gradient to `optimizer`, which moves `parameters`,
  /// sets new priorities and, at every target_update_interval-th call, copies the moved parameters
  /// to the (oldest) target network. Returns the loss. Allocates nothing after the first call.
  double update(const float* parameters, Optimizer<float>& optimizer, Rng& rng);

  /// Writes the best action of each of `batch` observations (batch x observation_size).
  void greedyActions(const float* parameters, const float* observations, int batch,
                     MlpWorkspace& workspace, double* actions) const;

  std::int64_t updates() const { return updates_; }  ///< calls of update() so far
  double epsilon() const { return epsilon_.at(updates_); }
  const PrioritisedReplay& replay() const { return replay_; }
  const AlignedFloats& targets() const { return targets_; }  ///< of the K networks, one by one
  const std::vector<std::unique_ptr<Env>>& envs() const { return envs_; }

  /// All but parameters and optimiser: replay, targets, environments in mid-episode, counters.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);

 private:
  std::int64_t stepAll(const float* parameters, double epsilon, Rng& rng);
  void computeTargets(const float* parameters);
  bool isAction(float action) const;
  double computeOutputGradient(const float* q_values);
  float* target(int k) { return targets_.data() + static_cast<std::size_t>(k) * network_.size(); }

  std::vector<std::unique_ptr<Env>> envs_;
  DqnSettings settings_;
  int observation_size_;
  int num_actions_;
  EpsilonSchedule epsilon_;
  Mlp network_;
  MlpWorkspace workspace_;
  PrioritisedReplay replay_;
  NStepAccumulator n_step_;
  AlignedFloats targets_;
  int newest_target_ = 0;
  std::int64_t updates_ = 0;
  bool started_ = false;

  // of the environments
  std::vector<float> observations_;       // num_envs x observation_size: where each one is
  std::vector<double> next_observation_;  // as the environment writes it
  std::vector<float> next_observation_float_;

  // of one update
  ReplayBatch batch_;
  std::vector<float> target_values_;    // batch x num_actions: Q_bar(s_n, .)
  std::vector<float> td_targets_;       // batch: y
  std::vector<float> td_errors_;        // batch: Q(s, a) - y
  std::vector<float> sample_gradient_;  // batch: of the loss by Q(s, a)
  std::vector<float> output_gradient_;  // batch x num_actions
  AlignedFloats gradient_;              // of all parameters
};

}  // namespace pmeta
