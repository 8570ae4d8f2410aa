#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// A view of one step of a stored trial.
struct TrialStep {
  const float* observation;       ///< s_t
  const float* action;            ///< a_t
  float reward;                   ///< that is trained on
  float evaluated_reward;         ///< that policies are judged by, and tasks told apart
  const float* next_observation;  ///< s_{t+1}, before any reset
};

/// A view of a stored trial: episodes of one task, one after the other. Valid until the next one
/// is added.
class StoredTrial {
 public:
  /// For TrialStore.
  StoredTrial(const float* rows, std::size_t steps, std::size_t observation_size,
              std::size_t action_size)
      : rows_(rows), steps_(steps), observations_(observation_size), actions_(action_size) {}

  /// Steps of all its episodes; at least 1.
  std::size_t steps() const { return steps_; }
  /// Step t, t below steps().
  TrialStep operator[](std::size_t t) const;

  /// Where the trial is after t steps, t up to steps(): the observation that step t acts on, which
  /// may be a new episode's first, or what the last one led to.
  const float* place(std::size_t t) const;

 private:
  const float* rows_;
  std::size_t steps_, observations_, actions_;
};

/// The most recent trials of one task.
class TrialStore {
 public:
  /// Up to `capacity` trials (at least 1) of up to `max_steps` steps each.
  TrialStore(std::size_t capacity, std::size_t max_steps, std::size_t observation_size,
             std::size_t action_size);

  /// Adds a step to the trial at hand.
  void add(const TrialStep& step);

  /// Keeps the trial at hand, unless it has no step; the next step begins another.
  void endTrial();

  std::size_t size() const { return steps_.size(); }  ///< trials kept
  /// The one in slot k, k below size().
  StoredTrial operator[](std::size_t k) const;

  /// To be called between trials.
  void saveState(StateWriter& writer) const;
  /// Refuses trials that are longer than max_steps.
  void loadState(StateReader& reader);

 private:
  std::size_t capacity_, max_steps_, observations_, actions_, stride_;
  std::size_t next_ = 0;             // slot that is written next
  std::vector<std::int64_t> steps_;  // by slot
  std::vector<float> values_;        // slots of max_steps rows: s, a, r, r as judged, s'
  std::vector<float> at_hand_;
};

}  // namespace pmeta
