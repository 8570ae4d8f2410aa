#include "pmeta_core/replay/replay_buffer.h"

#include <algorithm>
#include <string>

namespace pmeta {

ReplayBuffer::ReplayBuffer(std::size_t capacity, int observation_size, int action_size)
    : capacity_(capacity),
      observation_size_(static_cast<std::size_t>(observation_size)),
      action_size_(static_cast<std::size_t>(action_size)),
      stride_(2 * observation_size_ + action_size_ + 2) {
  // reserved, not written: pages that no transition has reached cost nothing
  values_.reserve(capacity_ * stride_);
}

std::size_t ReplayBuffer::add(const Transition& transition) {
  const std::size_t slot = next_;
  if (size_ < capacity_) values_.resize(++size_ * stride_);
  next_ = slot + 1 == capacity_ ? 0 : slot + 1;

  float* out = values_.data() + slot * stride_;
  out = std::copy_n(transition.observation, observation_size_, out);
  out = std::copy_n(transition.action, action_size_, out);
  *out++ = transition.reward;
  *out++ = transition.discount;
  std::copy_n(transition.next_observation, observation_size_, out);
  return slot;
}

void ReplayBuffer::clear() {
  size_ = next_ = 0;
  values_.clear();
}

Transition ReplayBuffer::operator[](std::size_t slot) const {
  const float* observation = values_.data() + slot * stride_;
  const float* action = observation + observation_size_;
  const float* scalars = action + action_size_;
  return {observation, action, scalars[0], scalars[1], scalars + 2};
}

void ReplayBuffer::saveState(StateWriter& writer) const {
  writer.array("values", values_);
  writer.count("next", static_cast<std::int64_t>(next_));
}

void ReplayBuffer::loadState(StateReader& reader) {
  const std::size_t n = reader.size<float>("values", capacity_ * stride_);
  if (n % stride_ != 0) {
    reader.refuse("values", "has " + std::to_string(n) + " values, which are no transitions of " +
                                std::to_string(stride_));
  }
  const std::size_t size = n / stride_;
  const bool full = size == capacity_;
  const auto last = static_cast<std::int64_t>(full ? size - 1 : size);
  next_ = static_cast<std::size_t>(reader.count("next", full ? 0 : last, last));
  values_.resize(n);
  size_ = size;
  reader.array("values", values_);
}

}  // namespace pmeta
