#pragma once

#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_networks.h"

namespace pmeta {

/// Adapts as PEARL does at test time: explores with z drawn from the prior in the first episode,
/// and from the posterior of all transitions before in each later one, unless with
/// settings.exploration_prior. What is known is the mean of q(z|c); before any episode that of the
/// prior, 0.
///
/// Episodes act by tanh(mean), or by samples of the policy with settings.exploration_noise.
class LatentAdaptation : public Adaptation {
 public:
  /// `parameters` (personal or meta) stay as they are; they and the networks must outlive this.
  /// Throws Error if `networks` has no encoder.
  LatentAdaptation(const SacNetworks& networks, const ContextSettings& settings,
                   const float* parameters);

  void beginEpisode(Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;
  void episodeOver() override;
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override;
  std::vector<float> taskInput() const override;

 private:
  const SacNetworks& networks_;
  const float* parameters_;
  const ContextEncoder& encoder_;
  bool on_prior_;  // in every episode
  ContextEncoder::Workspace workspace_;
  GaussianActor acting_;
  LatentPosterior posterior_;
  std::vector<double> noise_;
  std::vector<float> action_;
  std::vector<float> context_;  // rows of all episodes so far
};

}  // namespace pmeta
