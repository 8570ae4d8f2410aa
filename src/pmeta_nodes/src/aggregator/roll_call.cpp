#include "aggregator/roll_call.h"

namespace pmeta_nodes {

RollCall::RollCall(int agents, std::chrono::duration<double> patience,
                   std::chrono::duration<double> start, Clock::time_point now)
    : patience_(patience),
      start_patience_(start),
      start_(now),
      heard_(static_cast<std::size_t>(agents)) {}

void RollCall::heard(int agent, Clock::time_point now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (agent < 0 || agent >= static_cast<int>(heard_.size())) return;
  heard_[agent] = now;
}

std::vector<int> RollCall::silent(Clock::time_point now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<int> agents;
  for (std::size_t i = 0; i < heard_.size(); ++i) {
    const bool silent = heard_[i] ? now - *heard_[i] > patience_ : now - start_ > start_patience_;
    if (silent) agents.push_back(static_cast<int>(i));
  }
  return agents;
}

double RollCall::silence(int agent, Clock::time_point now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::chrono::duration<double>(now - heard_.at(agent).value_or(start_)).count();
}

bool RollCall::known(int agent) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return heard_.at(agent).has_value();
}

}  // namespace pmeta_nodes
