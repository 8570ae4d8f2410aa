#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/act/rollout.h"
#include "pmeta_core/baselines/metacure_explorer.h"
#include "pmeta_core/baselines/trial_store.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// One training task of MetaCURE: explorer and exploiter act in its environment by samples, in
/// whole episodes. All of it becomes replay, what the explorer does also trials.
class MetaCureCollector : private Actor {
 public:
  /// `buffer_size`: of the replay. The networks must outlive the collector, as `parameters` must.
  MetaCureCollector(std::unique_ptr<Env> env, const MetaCureNetworks& networks,
                    const float* parameters, const MetaCureSettings& settings,
                    std::size_t buffer_size);

  /// Trials until there are `steps` more transitions, at least one that is kept. Returns the
  /// transitions made.
  std::int64_t warmUp(std::int64_t steps, Rng& rng);

  /// A trial, then the exploiter's steps, on a z of its own in each episode. Returns the
  /// transitions made.
  std::int64_t visit(Rng& rng);

  /// Of all steps.
  const ReplayBuffer& replay() const { return replay_; }
  /// Of the explorer.
  const TrialStore& trials() const { return trials_; }
  /// So far.
  std::int64_t brokenEpisodes() const { return rollout_.broken().count(); }

  /// Replay, trials, and how many episodes broke down.
  void saveState(StateWriter& writer) const;
  /// The same.
  void loadState(StateReader& reader);

 private:
  enum class Acting { kExplorer, kOnPrior, kOnPosterior };

  std::int64_t trial(Rng& rng);
  std::int64_t exploit(Acting acting, std::int64_t steps, Rng& rng);
  std::int64_t runEpisode(Rng& rng);
  Actor& actor();
  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

  float gamma_;
  int trial_episodes_, prior_steps_, posterior_steps_;
  Rollout rollout_;
  ReplayBuffer replay_;
  TrialStore trials_;
  MetaCureExplorer explorer_;
  GaussianActor exploiter_;
  std::vector<float> action_;
  Acting acting_ = Acting::kExplorer;
  std::vector<float> belief_;  // that z is drawn from
};

}  // namespace pmeta
