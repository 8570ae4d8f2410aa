#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/replay/prioritised_replay.h"

namespace pmeta {

/// Turns the steps of several environments into n-step transitions.
///
/// A step at time t becomes (s_t, a_t, R_k, gamma^k, s_{t+k}), where R_k = sum_{j<k} gamma^j
/// r_{t+j} and k = n, or fewer where the episode ends earlier. The discount is 0 at a terminal
/// state; at the horizon the value of the last state goes on (gamma^k), unless the limit counts as
/// terminal.
class NStepAccumulator {
 public:
  /// Steps of one environment that wait for their n-th reward: a ring of n slots.
  struct Queue {
    int first = 0;                    ///< slot of the oldest
    int size = 0;                     ///< how many wait
    std::vector<float> observations;  ///< n x observation_size
    std::vector<float> actions;       ///< n x action_size
    std::vector<double> returns;      ///< n: rewards so far, discounted

    void saveState(StateWriter& writer) const;  ///< all slots, waiting or not
    /// Refuses another n or other sizes, and a slot or count out of range.
    void loadState(StateReader& reader);
  };

  /// n: at least 1. gamma: in [0, 1].
  NStepAccumulator(int num_envs, int n, double gamma, int observation_size, int action_size,
                   bool bootstrap_at_limit);

  /// Takes step (observation, action, step.reward, next_observation) of environment `env`, and adds
  /// to `replay` what is complete: at most one transition, or at an episode's end all that wait,
  /// the oldest first.
  void add(int env, const float* observation, const float* action, const Step& step,
           const float* next_observation, PrioritisedReplay& replay);

  /// Drops the steps of environment `env` that wait for rewards which will never come.
  void drop(int env) { queues_[static_cast<std::size_t>(env)].size = 0; }

  void saveState(StateWriter& writer) const;  ///< every environment's steps that still wait
  /// Refuses as Queue::loadState() does, or where there are fewer environments.
  void loadState(StateReader& reader);

  const std::vector<Queue>& queues() const { return queues_; }  ///< by environment

 private:
  int slot(const Queue& queue, int age) const { return (queue.first + age) % n_; }
  void emitOldest(Queue& queue, bool bootstraps, const float* next_observation,
                  PrioritisedReplay& replay);

  int n_;
  std::size_t observation_size_;
  std::size_t action_size_;
  bool bootstrap_at_limit_;
  std::vector<double> powers_;  // gamma^0 ... gamma^n
  std::vector<Queue> queues_;   // by environment
};

}  // namespace pmeta
