#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/baselines/pearl_collector.h"
#include "pmeta_core/baselines/pearl_settings.h"
#include "pmeta_core/learn/sac_update.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// PEARL (Rakelly et al., "Efficient Off-Policy Meta-Reinforcement Learning via Probabilistic
/// Context Variables", 2019): soft actor-critic on the replays of all tasks, whose networks take a
/// z that is inferred from the task's own context.
///
/// An iteration visits some tasks (see PearlCollector), then makes updates, each on meta_batch
/// tasks that give a context and an equal part of SacUpdate's batch. The first one warms all tasks
/// up.
///
/// Other than the release: the first episode of the posterior phase acts on the posterior, too, and
/// test tasks count exploration in episodes, which act on the mean: see LatentAdaptation.
class Pearl : public MetaLearner {
 public:
  /// Throws Error if the tasks' actions are discrete, or the replays do not fit into memory.
  Pearl(const MetaTasks& tasks, const PearlSettings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  const Model& model() const override { return model_; }
  /// Those to begin with are also the first targets.
  void setModel(const Model& model) override;
  IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) override;
  /// Means over the iteration's updates.
  const std::vector<Loss>& losses() const override { return losses_; }
  std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const override;
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

  /// One update of an iteration, on what there is after its steps. Allocates nothing.
  SacLosses update(Rng& rng);

  /// The i-th training task with its data.
  const PearlCollector& task(std::size_t i) const { return *tasks_[i]; }
  /// What the parameters are of.
  const SacNetworks& networks() const { return policies_.networks(); }

 private:
  std::int64_t brokenEpisodes() const;
  void collect(std::uint64_t seed, std::uint64_t iteration, Rng& rng, IterationStats& stats);

  PearlSettings settings_;
  SacSettings update_settings_;
  int threads_;
  SacPolicies policies_;
  Model model_;
  ProximalAdam optimizer_;
  SacUpdate update_;
  std::vector<std::unique_ptr<PearlCollector>> tasks_;
  bool started_ = false;
  std::vector<Loss> losses_;
};

/// PEARL's kind: "pearl".
class PearlKind : public MetaLearnerKind {
 public:
  void bind(Settings& settings) override { pmeta::bind(settings, "pearl.", settings_); }
  void check(int num_tasks) const override { pmeta::check(settings_, num_tasks); }
  void setPortable(bool portable) override {
    settings_.sac.portable = settings_.sac.context.portable = portable;
  }
  std::vector<int> explorationEpisodes() const override {
    return settings_.sac.context.exploration_episodes;
  }
  int evaluationEpisodes() const override { return settings_.sac.evaluation_episodes; }
  std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const override;
  std::unique_ptr<PolicyFamily> policies(const Env& env, int num_tasks) const override;
  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                         const Model& policy) const override;
  /// The prior's mean.
  std::optional<std::vector<float>> metaInput(int task, int num_tasks) const override;

 private:
  PearlSettings settings_;
};

}  // namespace pmeta
