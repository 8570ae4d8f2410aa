#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/rollout.h"
#include "pmeta_core/baselines/advantages.h"
#include "pmeta_core/baselines/gaussian_mlp_policies.h"
#include "pmeta_core/baselines/surrogate.h"

namespace pmeta {

/// Acts by samples of a GaussianMlp and keeps what came of it: paths, and u as it was drawn.
class RecordingActor : public GaussianMlpActor {
 public:
  /// As GaussianMlpActor.
  RecordingActor(const GaussianMlp& policy, double scale, std::vector<double> parameters,
                 std::size_t max_batch);

  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

  /// Steps so far, of episodes that have at least one.
  std::size_t steps() const;
  /// All episodes so far, each environment's in their order.
  std::vector<Path> paths() const;
  /// The same with their advantages: a baseline fitted to these very episodes, normalised.
  ActionData data(const AdvantageSettings& settings) const;

 private:
  void draw(const double* mean, Rng& rng, double* u) override;

  struct Recorded {
    Path path;
    std::vector<double> actions, means;  // [steps, actions]
  };
  std::vector<const Recorded*> episodes() const;

  std::vector<double> std_;
  std::vector<std::vector<Recorded>> recorded_;  // by environment
  std::vector<std::size_t> envs_;                // looked at
  std::size_t acting_in_ = 0;                    // environment that acts
  std::vector<double> mean_, u_;                 // of its step
};

/// Episodes of one task for an on-policy learner.
class OnPolicySampler {
 public:
  /// One environment for each episode, which are stepped side by side.
  explicit OnPolicySampler(std::vector<std::unique_ptr<Env>> envs);

  /// One episode in each environment. Throws BrokenEpisode where ten running broke down, or where
  /// none has a step.
  ActionData sample(const GaussianMlp& policy, double scale, const std::vector<double>& parameters,
                    const AdvantageSettings& settings, Rng& rng);

  /// Mean undiscounted return of those episodes, as policies are judged.
  double meanReturn() const { return mean_return_; }
  std::int64_t brokenEpisodes() const { return rollout_.broken().count(); }  ///< in all

  /// The count of episodes that broke down.
  void saveState(StateWriter& writer) const { writer.part("broken", rollout_.broken()); }
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) { reader.part("broken", rollout_.broken()); }

 private:
  Rollout rollout_;
  double mean_return_ = 0;
};

}  // namespace pmeta
