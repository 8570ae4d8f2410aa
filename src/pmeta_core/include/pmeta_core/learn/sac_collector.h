#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/act/rollout.h"
#include "pmeta_core/learn/context_store.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Acts in one environment by samples of the policy that soft actor-critic trains, and keeps what
/// comes of it in the replay and, with an encoder, as context.
class SacCollector : private Actor {
 public:
  /// `task_input`: x of the actor, where no encoder infers it. `context`: where transitions become
  /// context; nullptr without an encoder. The networks and it must outlive the collector.
  SacCollector(std::unique_ptr<Env> env, const SacNetworks& networks, const SacSettings& settings,
               std::vector<float> task_input, ContextStore* context);

  /// env_steps_per_update steps; the first call also starts the environment and warms it up by
  /// uniformly random actions. With an encoder, z is drawn anew for each episode: from the prior in
  /// every prior_interval-th, else from q(z|c). On z from the prior `explorer` acts, if not null:
  /// another actor's parameters. Those transitions become context, and with posterior_episodes all
  /// do, in the reward that policies are judged by.
  /// An episode that breaks down is counted, and another begun; of its last step nothing is kept.
  /// Returns the transitions made. Allocates nothing once the buffers are full.
  std::int64_t collect(const float* parameters, Rng& rng, const float* explorer);

  /// Transitions, warm-up included; empty before the first collect().
  const ReplayBuffer& replay() const { return replay_; }
  const std::vector<float>& taskInput() const { return acting_.taskInput(); }  ///< while acting
  const Env& env() const { return rollout_.env(0); }  ///< as the last step has left it
  /// Episodes so far whose simulation broke down.
  std::int64_t brokenEpisodes() const { return rollout_.broken().count(); }

  /// Replay, counts and the episode at hand; the context is its store's.
  void saveState(StateWriter& writer) const;
  /// Refuses an empty replay after the start, and another task's input.
  void loadState(StateReader& reader);

 private:
  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

  const SacNetworks& networks_;
  SacSettings settings_;
  ContextStore* context_;
  std::optional<InferredTask> task_;
  Rollout rollout_;
  ReplayBuffer replay_;
  GaussianActor acting_;
  std::vector<float> action_;
  std::int64_t episodes_ = 0;  // after the warm-up
  bool started_ = false;
  bool prior_episode_ = true;  // this episode's transitions become context
  // of the call of collect()
  const float* parameters_ = nullptr;
  const float* explorer_ = nullptr;
  bool random_ = true;
};

}  // namespace pmeta
