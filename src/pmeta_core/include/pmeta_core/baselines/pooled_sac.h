#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/learn/sac_collector.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/sac_update.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// Settings of soft actor-critic on all tasks. Of `sac` those apply that are bound below.
struct PooledSacSettings {
  PooledSacSettings();

  SacSettings sac;                  ///< env_steps_per_update: of an iteration, on each task
  double learning_rate = 1e-3;      ///< Adam's, of all networks
  int updates_per_iteration = 100;  ///< after its steps
  bool gradient_surgery = false;    ///< between the tasks: see operate()
};

/// Binds all of them below `prefix`, e.g. "pooled_sac.".
void bind(Settings& settings, const std::string& prefix, PooledSacSettings& pooled);

/// Multi-task soft actor-critic: one actor and critics for all tasks, trained on batches of which
/// each task's replay gives an equal part. With task_encoding "one_hot" the networks are told the
/// task, and what sharing trajectories is worth shows; with "multi_head" each task has a last layer
/// of its own as well, of all networks; with "none" they are not told, and what one policy for all
/// comes to shows.
class PooledSac : public MetaLearner {
 public:
  /// Throws Error if actions are discrete, or a batch has no row for each task.
  PooledSac(const MetaTasks& tasks, const PooledSacSettings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  const Model& model() const override { return model_; }
  /// Those to begin with are also the first targets.
  void setModel(const Model& model) override;
  IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) override;
  /// Means over the iteration's updates.
  const std::vector<Loss>& losses() const override { return losses_; }
  /// It does not explore: it is told the task, or acts alike on all.
  std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const override;
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

 private:
  SacLosses updateOnce(Rng& rng);
  std::int64_t brokenEpisodes() const;

  int updates_per_iteration_;
  int threads_;
  SacPolicies policies_;
  Model model_;
  ProximalAdam optimizer_;
  SacUpdate update_;
  std::vector<std::vector<float>> task_inputs_;
  std::vector<std::unique_ptr<SacCollector>> collectors_;  // of each task
  bool started_ = false;
  std::vector<Loss> losses_;
};

}  // namespace pmeta
