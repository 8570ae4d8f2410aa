#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/baselines/metacure_networks.h"

namespace pmeta {

/// MetaCURE's explorer in one environment, whose episodes are one trial: acts on its belief, which
/// every step refreshes. A step that breaks its episode down leaves no trace.
class MetaCureExplorer : public Actor {
 public:
  /// `parameters`, all of the networks', stay where they are but may change; they and the networks
  /// must outlive it.
  MetaCureExplorer(const MetaCureNetworks& networks, const float* parameters, GaussianActor::By by);

  /// A trial begins.
  void forget();

  /// By all that was seen: mean, then variance. Before the first step the prior.
  std::vector<float> belief() const;

  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

 private:
  const MetaCureNetworks& networks_;
  const float* parameters_;
  GaussianActor acting_;
  mutable BeliefEncoder::Workspace workspace_;
  std::vector<float> hidden_, next_hidden_;  // before and after the token of the step at hand
  std::vector<float> token_;                 // where it is, then the last action and its reward
  bool begun_ = false;                       // has there been a step?
};

/// Adapts as MetaCURE does: the explorer explores, by its mean action, and the exploiter acts on
/// the mean of what it believes in the end. Before exploration that is the prior's, 0.
class MetaCureAdaptation : public Adaptation {
 public:
  /// `parameters` stay as they are; they and the networks must outlive this.
  MetaCureAdaptation(const MetaCureNetworks& networks, const float* parameters);

  void beginEpisode(Rng&) override {}
  void episodeOver() override {}
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    explorer_.look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return explorer_.act(row, rng, action);
  }
  void observe(const Experience& experience) override { explorer_.observe(experience); }
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override;
  std::vector<float> taskInput() const override;

 private:
  const MetaCureNetworks& networks_;
  const float* parameters_;
  MetaCureExplorer explorer_;
};

}  // namespace pmeta
