#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/baselines/rl2_networks.h"
#include "pmeta_core/baselines/rl2_update.h"
#include "pmeta_core/baselines/running_variance.h"
#include "pmeta_core/baselines/trials.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// RL² (Duan et al., 2016; Wang et al., 2016): a recurrent policy that remembers a trial of several
/// episodes, trained by proximal policy optimisation for the return of the whole trial.
///
/// Of VariBAD's baseline, whose settings are the default ones, it leaves out the networks before
/// the recurrent one and the latent layer behind it; trials are unrolled whole; and what an
/// episode's last step gave is seen by the next one.
class Rl2 : public MetaLearner {
 public:
  /// Throws Error where actions are discrete.
  Rl2(const MetaTasks& tasks, const Rl2Settings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  const Model& model() const override { return model_; }
  void setModel(const Model& model) override;
  IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) override;
  const std::vector<Loss>& losses() const override { return losses_; }
  std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const override;
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

 private:
  void makeTargets();
  void scaleRewards();
  void valueAdvantages();
  void linearAdvantages();
  void normaliseAdvantages();
  PpoLoss learn(Rng& rng, std::int64_t& updates);
  void move();

  Rl2Settings settings_;
  int num_tasks_;
  Rl2Policies policies_;
  Model model_;
  ProximalAdam adam_;
  RunningVariance return_variance_;
  TrialSampler sampler_;
  Rl2Update update_;
  std::vector<Loss> losses_;
  // of one iteration
  std::vector<Trial> trials_;
  std::vector<TrialTargets> targets_;
  std::vector<std::size_t> order_;  // of trials with at least one step
  std::vector<std::size_t> minibatch_;
  AlignedFloats gradient_;
};

}  // namespace pmeta
