#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/act/rollout.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/task_source.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Acts in one environment by samples of the policy that soft actor-critic trains, and keeps what
/// comes of it in the replay; a TaskSource may tell the actor the task anew for each episode.
class SacCollector : private Actor {
 public:
  /// `task_input`: x of the actor, for good where `source` is nullptr. The networks and the source
  /// must outlive the collector.
  SacCollector(std::unique_ptr<Env> env, const SacNetworks& networks, const SacSettings& settings,
               std::vector<float> task_input, TaskSource* source);

  /// env_steps_per_update steps; the first call also starts the environment and warms it up by
  /// uniformly random actions. In episodes that explore, by what the source says, `explorer` acts,
  /// if not null: another actor's parameters.
  /// An episode that breaks down is counted, and another begun; of its last step nothing is kept.
  /// Returns the transitions made. Allocates nothing once the buffers are full.
  std::int64_t collect(const float* parameters, Rng& rng, const float* explorer);

  /// Transitions, warm-up included; empty before the first collect().
  const ReplayBuffer& replay() const { return replay_; }
  const std::vector<float>& taskInput() const { return acting_.taskInput(); }  ///< while acting
  const Env& env() const { return rollout_.env(0); }  ///< as the last step has left it
  /// Episodes so far whose simulation broke down.
  std::int64_t brokenEpisodes() const { return rollout_.broken().count(); }

  /// Replay, counts and the episode at hand, without what the source keeps.
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
  TaskSource* source_;
  Rollout rollout_;
  ReplayBuffer replay_;
  GaussianActor acting_;
  std::vector<float> action_;
  std::int64_t episodes_ = 0;  // after the warm-up
  bool started_ = false;
  bool explores_ = false;  // the episode at hand
  // of the call of collect()
  const float* parameters_ = nullptr;
  const float* explorer_ = nullptr;
  bool random_ = true;
};

}  // namespace pmeta
