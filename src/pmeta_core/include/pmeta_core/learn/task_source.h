#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pmeta_core/learn/context_store.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// What the actor of a training episode is told of the task, and what is kept of the episode to get
/// to know tasks by. Nothing of it lasts but what is kept.
class TaskSource {
 public:
  virtual ~TaskSource() = default;

  /// An episode begins, the `episode`-th after those of the warm-up, or nothing: one of these.
  /// Writes what its actor, whose networks are at `parameters`, is told. True: it explores.
  virtual bool begin(std::optional<std::int64_t> episode, const float* parameters, Rng& rng,
                     std::vector<float>& task_input) = 0;

  /// Takes in a step of an episode that explores or does not, with the reward that policies are
  /// judged by. True: actor and critics learn from it, too.
  virtual bool observe(const Transition& judged, bool explores) = 0;
};

/// z from the context encoder: drawn from the prior where the episode explores, else from q(z|c).
class InferredTasks : public TaskSource {
 public:
  /// The networks, which have an encoder, and the store must outlive this.
  InferredTasks(const SacNetworks& networks, const ContextSettings& settings, ContextStore& store);

  /// Every settings.prior_interval-th episode explores, and all while nothing is kept.
  bool begin(std::optional<std::int64_t> episode, const float* parameters, Rng& rng,
             std::vector<float>& task_input) override;
  /// Keeps what explores and, with settings.posterior_episodes, all else.
  bool observe(const Transition& judged, bool explores) override;

 private:
  const SacNetworks& networks_;
  ContextSettings settings_;
  ContextStore& store_;
  InferredTask task_;
};

/// The task's own one-hot vector, or, where the episode explores, that of a task drawn from all: an
/// agent of a TaskModel sees at times what becomes of a wrong guess.
class OwnOrDrawnTask : public TaskSource {
 public:
  /// `own`: the task's own. What is kept must outlive this.
  OwnOrDrawnTask(std::vector<float> own, const TaskModelSettings& settings, ReplayBuffer& kept);

  /// Every settings.exploring_interval-th episode explores.
  bool begin(std::optional<std::int64_t> episode, const float* parameters, Rng& rng,
             std::vector<float>& task_input) override;
  /// Keeps all.
  bool observe(const Transition& judged, bool explores) override;

 private:
  std::vector<float> own_;
  int interval_;
  bool explored_to_replay_;
  ReplayBuffer& kept_;
};

}  // namespace pmeta
