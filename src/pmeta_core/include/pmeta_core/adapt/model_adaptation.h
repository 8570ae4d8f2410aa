#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/adapt/task_posterior.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"

namespace pmeta {

/// Adapts by the posterior that a learnt model of the tasks gives. Explores by posterior sampling
/// (Thompson, 1933): each episode acts as on a task drawn by its weight; where its weight falls
/// below half of the greatest, the guess is refuted, and another is drawn at once. What is known is
/// the likeliest hypothesis; before any transition the mean of all tasks trained on.
///
/// Episodes act by tanh(mean), or by samples of the policy with settings.context.exploration_noise.
class ModelAdaptation : public Adaptation {
 public:
  /// `parameters` (personal or meta) stay as they are; they and the networks must outlive this.
  /// Throws Error if `networks` has no task model.
  ModelAdaptation(const SacNetworks& networks, const SacSettings& settings,
                  const float* parameters);

  void beginEpisode(Rng& rng) override { guess(rng); }
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;
  void episodeOver() override {}
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override;
  std::vector<float> taskInput() const override { return posterior_.best(); }
  std::vector<double> taskWeights() const override { return posterior_.weights(); }

  std::size_t guessed() const { return guess_; }  ///< the task that it acts as on

 private:
  void guess(Rng& rng);
  bool refuted() const;

  const SacNetworks& networks_;
  const float* parameters_;
  TaskPosterior posterior_;
  GaussianActor acting_;
  std::size_t guess_ = 0;
  std::vector<float> observation_;  // that is to be acted on
  std::vector<float> action_;
};

}  // namespace pmeta
