#include "pmeta_core/run/roll_call.h"

namespace pmeta {

RollCall::RollCall(int agents, Seconds patience, Seconds start_up, Time now)
    : patience_(patience),
      start_up_(start_up),
      start_(now),
      heard_(static_cast<std::size_t>(agents)) {}

void RollCall::heard(int agent, Time now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (agent < 0 || agent >= static_cast<int>(heard_.size())) return;
  heard_[agent] = now;
}

std::vector<int> RollCall::silent(Time now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<int> agents;
  for (std::size_t i = 0; i < heard_.size(); ++i) {
    const bool silent = heard_[i] ? now - *heard_[i] > patience_ : now - start_ > start_up_;
    if (silent) agents.push_back(static_cast<int>(i));
  }
  return agents;
}

double RollCall::silence(int agent, Time now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return Seconds(now - heard_.at(agent).value_or(start_)).count();
}

bool RollCall::known(int agent) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return heard_.at(agent).has_value();
}

}  // namespace pmeta
