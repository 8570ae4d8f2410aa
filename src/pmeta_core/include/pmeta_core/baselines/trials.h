#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/baselines/rl2_networks.h"

namespace pmeta {

/// Some episodes of one task, one after the other, as a policy of RL² acted in them by samples.
struct Trial {
  /// Which training task it is of.
  int task = 0;
  std::size_t steps = 0;  ///< of all its episodes
  // rows by step
  AlignedFloats inputs;     ///< of the recurrent network
  AlignedFloats actions;    ///< as they were drawn
  AlignedFloats rewards;    ///< that are learnt from
  double first_return = 0;  ///< of the first episode, as policies are judged
  double last_return = 0;   ///< of the last one
};

/// Plays trials, those of one task side by side and tasks on threads of their own. An episode that
/// breaks down ends there; the trial goes on with the next one.
class TrialSampler {
 public:
  /// Trials of `episodes` episodes each, up to `max_trials` at a time. The networks must outlive
  /// the sampler.
  TrialSampler(const MetaTasks& tasks, const Rl2Networks& networks, int episodes,
               std::size_t max_trials);
  ~TrialSampler();

  /// Plays trial k on task (iteration * trials.size() + k) mod tasks, so that all tasks have their
  /// turn, by Rng(seed, task, Stream::kCollect, iteration). Adds to the statistics. Throws
  /// BrokenEpisode where too many running broke down.
  void play(const float* parameters, std::uint64_t seed, std::uint64_t iteration,
            std::vector<Trial>& trials, IterationStats& stats);

  /// Counts of broken episodes.
  void saveState(StateWriter& writer) const;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader);

 private:
  class OneTask;

  std::vector<std::unique_ptr<OneTask>> tasks_;
  int threads_;
};

}  // namespace pmeta
