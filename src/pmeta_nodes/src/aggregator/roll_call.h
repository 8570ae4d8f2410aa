#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <vector>

namespace pmeta_nodes {

/// When each agent was last heard of, and which have fallen silent. May be asked from any thread.
class RollCall {
 public:
  using Clock = std::chrono::steady_clock;

  /// `patience`: silence after which an agent counts as missing; `start`: the same before its
  /// first word, while it may still be starting.
  RollCall(int agents, std::chrono::duration<double> patience, std::chrono::duration<double> start,
           Clock::time_point now = Clock::now());

  void heard(int agent, Clock::time_point now = Clock::now());

  /// Agents that are silent, ascending.
  std::vector<int> silent(Clock::time_point now = Clock::now()) const;

  /// Seconds since it was last heard of, or since the start.
  double silence(int agent, Clock::time_point now = Clock::now()) const;

  /// Has it ever been heard of?
  bool known(int agent) const;

 private:
  const std::chrono::duration<double> patience_;
  const std::chrono::duration<double> start_patience_;
  const Clock::time_point start_;
  mutable std::mutex mutex_;
  std::vector<std::optional<Clock::time_point>> heard_;
};

}  // namespace pmeta_nodes
