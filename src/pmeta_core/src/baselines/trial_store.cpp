#include "pmeta_core/baselines/trial_store.h"

#include <algorithm>

namespace pmeta {

TrialStep StoredTrial::operator[](std::size_t t) const {
  const float* observation = rows_ + t * (2 * observations_ + actions_ + 2);
  const float* action = observation + observations_;
  const float* rewards = action + actions_;
  return {observation, action, rewards[0], rewards[1], rewards + 2};
}

const float* StoredTrial::place(std::size_t t) const {
  return t < steps_ ? (*this)[t].observation : (*this)[t - 1].next_observation;
}

TrialStore::TrialStore(std::size_t capacity, std::size_t max_steps, std::size_t observation_size,
                       std::size_t action_size)
    : capacity_(capacity),
      max_steps_(max_steps),
      observations_(observation_size),
      actions_(action_size),
      stride_(2 * observation_size + action_size + 2) {}

void TrialStore::add(const TrialStep& step) {
  at_hand_.insert(at_hand_.end(), step.observation, step.observation + observations_);
  at_hand_.insert(at_hand_.end(), step.action, step.action + actions_);
  at_hand_.push_back(step.reward);
  at_hand_.push_back(step.evaluated_reward);
  at_hand_.insert(at_hand_.end(), step.next_observation, step.next_observation + observations_);
}

void TrialStore::endTrial() {
  if (at_hand_.empty()) return;
  if (next_ == size()) {
    steps_.push_back(0);
    values_.resize(values_.size() + max_steps_ * stride_);
  }
  steps_[next_] = static_cast<std::int64_t>(at_hand_.size() / stride_);
  std::copy(at_hand_.begin(), at_hand_.end(), &values_[next_ * max_steps_ * stride_]);
  next_ = (next_ + 1) % capacity_;
  at_hand_.clear();
}

StoredTrial TrialStore::operator[](std::size_t k) const {
  return {&values_[k * max_steps_ * stride_], static_cast<std::size_t>(steps_[k]), observations_,
          actions_};
}

void TrialStore::saveState(StateWriter& writer) const {
  writer.array("steps", steps_);
  writer.array("values", values_);
  writer.count("next", static_cast<std::int64_t>(next_));
}

void TrialStore::loadState(StateReader& reader) {
  steps_.resize(reader.size<std::int64_t>("steps", capacity_));
  reader.array("steps", steps_);
  for (const std::int64_t steps : steps_) {
    if (steps < 1 || steps > static_cast<std::int64_t>(max_steps_)) {
      reader.refuse("steps", "holds a trial of " + std::to_string(steps) + " steps");
    }
  }
  values_.resize(size() * max_steps_ * stride_);
  reader.array("values", values_);
  const auto last = static_cast<std::int64_t>(size());
  const bool full = size() == capacity_;
  next_ = static_cast<std::size_t>(reader.count("next", full ? 0 : last, full ? last - 1 : last));
}

}  // namespace pmeta
