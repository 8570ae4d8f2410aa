#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <vector>

namespace pmeta {

/// When each agent was last heard of, and which have fallen silent. May be asked from any thread.
class RollCall {
 public:
  using Time = std::chrono::steady_clock::time_point;  ///< a point of the owner's clock
  using Seconds = std::chrono::duration<double>;       ///< as a number with decimals

  /// `patience`: silence after which an agent counts as missing; `start_up`: the same before its
  /// first word, while it may still be starting.
  RollCall(int agents, Seconds patience, Seconds start_up, Time now);

  /// Takes a sign of life of an agent; one that is none of theirs is ignored.
  void heard(int agent, Time now);

  /// Agents that are silent, ascending.
  std::vector<int> silent(Time now) const;

  /// Seconds since it was last heard of, or since the start.
  double silence(int agent, Time now) const;

  /// Has it ever been heard of?
  bool known(int agent) const;

 private:
  const Seconds patience_;
  const Seconds start_up_;
  const Time start_;
  mutable std::mutex mutex_;
  std::vector<std::optional<Time>> heard_;
};

}  // namespace pmeta
