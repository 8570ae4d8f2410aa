#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/act/rollout.h"
#include "pmeta_core/learn/context_store.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// One training task of PEARL: acts in its environment by samples of the meta-policy, in whole
/// episodes, and keeps what comes of it in the task's replay and as its context.
class PearlCollector : private Actor {
 public:
  /// `buffer_size`: of the replay. The networks must outlive the collector.
  PearlCollector(std::unique_ptr<Env> env, const SacNetworks& networks, const SacSettings& settings,
                 std::size_t buffer_size);

  /// Episodes until there are `steps` more transitions, each on a z from the prior; all become
  /// context. Returns the transitions made.
  std::int64_t explore(const float* parameters, std::int64_t steps, Rng& rng);

  /// Forgets the context, explores for `prior_steps`, then goes on for `posterior_steps` in
  /// episodes that act on a z of q(z|c) each. These become context with posterior_episodes alone.
  /// Returns the transitions made.
  std::int64_t visit(const float* parameters, std::int64_t prior_steps,
                     std::int64_t posterior_steps, Rng& rng);

  /// All transitions that are kept.
  const ReplayBuffer& replay() const { return replay_; }
  /// Those of the last visit that tell the task.
  const ContextStore& context() const { return context_; }
  /// In all.
  std::int64_t brokenEpisodes() const { return rollout_.broken().count(); }

  /// Replay, context and the count of broken episodes.
  void saveState(StateWriter& writer) const;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader);

 private:
  std::int64_t runEpisodes(std::int64_t steps, Rng& rng);
  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

  const SacNetworks& networks_;
  float gamma_;
  bool posterior_is_context_;
  Rollout rollout_;
  ReplayBuffer replay_;
  ContextStore context_;
  InferredTask task_;
  GaussianActor acting_;
  std::vector<float> action_;
  // of the call
  const float* parameters_ = nullptr;
  bool on_prior_ = true;
};

}  // namespace pmeta
