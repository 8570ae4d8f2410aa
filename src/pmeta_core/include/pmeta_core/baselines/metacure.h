#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/baselines/information_gain.h"
#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/baselines/metacure_collector.h"
#include "pmeta_core/baselines/metacure_networks.h"
#include "pmeta_core/baselines/metacure_settings.h"
#include "pmeta_core/learn/sac_update.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// MetaCURE (Zhang et al., "MetaCURE: Meta Reinforcement Learning with Empowerment-Driven
/// Exploration", 2021): two soft actor-critics over one recurrent encoder of trials. The explorer
/// acts on the belief and is rewarded for what tells of the task, too (see InformationGain); the
/// exploiter acts on a z from the belief, and its critics train the encoder.
///
/// An iteration visits some tasks (see MetaCureCollector), then makes updates, each on meta_batch
/// tasks that give a whole trial and an equal part of the batch:
///
///     exploiter:  steps of the replay, each with z ~ b_t of the trial, t uniform
///     encoder:    the sum of both critics' losses by z + kl_weight * mean KL(b_t || N(0, I))
///     predictors: the same steps and beliefs
///     explorer:   steps of the trial with b_t and b_{t+1}, t uniform; the reward is
///                 r + gain_weight * gain; an episode's end leads on to the next one's start, and
///                 the trial's is terminal
///
/// With pairing "released" the explorer learns from steps of the replay instead, each with b_t and
/// b_{t+1} of the trial, t uniform.
///
/// Other than the release: the encoder is a GRU; contexts are whole trials from their start;
/// posterior steps are on the posterior; and a KL takes variances for variances.
class MetaCure : public MetaLearner {
 public:
  /// Throws Error if the tasks' actions are discrete, or the replays do not fit into memory.
  MetaCure(const MetaTasks& tasks, const MetaCureSettings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  const Model& model() const override { return model_; }
  /// Those to begin with are also the first targets.
  void setModel(const Model& model) override;
  IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) override;
  /// Means over the iteration's updates.
  const std::vector<Loss>& losses() const override { return losses_; }
  std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const override;
  void saveState(StateWriter& writer) const override;
  void loadState(StateReader& reader) override;

  /// The i-th of those that are trained on.
  const MetaCureCollector& task(std::size_t i) const { return *tasks_[i]; }

 private:
  // a step of the replay and the belief that z is drawn from
  struct Row {
    std::size_t trial, t;
    Transition step;
  };

  const MetaCureNetworks& networks() const { return policies_.networks(); }
  std::int64_t brokenEpisodes() const;
  void collect(std::uint64_t seed, std::uint64_t iteration, Rng& rng, IterationStats& stats);
  void updateOnce(Rng& rng);
  void drawTrials(Rng& rng);
  void drawRows(Rng& rng);
  double updateEncoder();
  double updateExplorer(Rng& rng);
  Row explorerRow(std::size_t row, Rng& rng) const;

  MetaCureSettings settings_;
  int threads_;
  MetaCurePolicies policies_;
  Model model_;
  ProximalAdam adam_;
  SacUpdate exploiter_, explorer_;
  TrialBeliefs beliefs_;
  InformationGain gain_;
  std::vector<std::unique_ptr<MetaCureCollector>> tasks_;
  bool started_ = false;
  std::vector<Loss> losses_;
  // of one update
  std::vector<std::size_t> drawn_;  // tasks
  std::vector<StoredTrial> trials_;
  std::vector<Row> rows_;
  std::vector<float> noise_, z_;  // [rows, latent_size]
  AlignedFloats encoder_gradient_;
};

}  // namespace pmeta
