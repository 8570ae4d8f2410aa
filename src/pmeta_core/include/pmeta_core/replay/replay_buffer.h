#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// A view of one stored transition; valid until the next add().
///
/// The learner's target is `reward + discount * V(next_observation)`, whatever the number of steps.
struct Transition {
  const float* observation;       ///< s_t
  const float* action;            ///< a_t; a discrete action a is stored as action[0] == a
  float reward;                   ///< R_n = sum over j < n of gamma^j r_{t+j}
  float discount;                 ///< gamma^n, or 0 where nothing is to be bootstrapped
  const float* next_observation;  ///< s_{t+n}
};

/// Ring buffer of transitions in float32: once full, the oldest is overwritten.
///
/// Memory is reserved at construction and becomes resident as transitions arrive:
/// 4 * (2 * observation_size + action_size + 2) bytes each.
class ReplayBuffer {
 public:
  /// capacity: at least 1.
  ReplayBuffer(std::size_t capacity, int observation_size, int action_size);

  /// Copies a transition and returns its slot.
  std::size_t add(const Transition& transition);

  /// What is held there; `slot` must be below size().
  Transition operator[](std::size_t slot) const;

  std::size_t capacity() const { return capacity_; }  ///< transitions it has room for
  std::size_t size() const { return size_; }          ///< transitions held
  std::size_t next() const { return next_; }          ///< slot that add() writes next
  int observationSize() const { return static_cast<int>(observation_size_); }  ///< floats of s_t
  int actionSize() const { return static_cast<int>(action_size_); }            ///< floats of a_t

  /// All transitions as they lie in memory, slot by slot: s_t, a_t, R_n, discount, s_{t+n}.
  const std::vector<float>& values() const { return values_; }

  /// Straight from and to its memory: no second copy is made.
  void saveState(StateWriter& writer) const;
  /// Refuses more transitions than it has room for, and half ones.
  void loadState(StateReader& reader);

 private:
  std::size_t capacity_;
  std::size_t observation_size_;
  std::size_t action_size_;
  std::size_t stride_;  // floats of a transition
  std::size_t size_ = 0;
  std::size_t next_ = 0;
  std::vector<float> values_;
};

}  // namespace pmeta
