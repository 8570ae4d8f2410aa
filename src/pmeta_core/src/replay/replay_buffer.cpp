#include "pmeta_core/replay/replay_buffer.h"

#include <algorithm>
#include <string>

#include "pmeta_core/base/error.h"

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

Transition ReplayBuffer::operator[](std::size_t slot) const {
  const float* observation = values_.data() + slot * stride_;
  const float* action = observation + observation_size_;
  const float* scalars = action + action_size_;
  return {observation, action, scalars[0], scalars[1], scalars + 2};
}

void ReplayBuffer::restore(const std::vector<float>& values, std::size_t next) {
  const std::size_t size = values.size() / stride_;
  const bool full = size == capacity_;
  if (values.size() % stride_ != 0 || size > capacity_ || (full ? next >= size : next != size)) {
    throw Error("a replay of " + std::to_string(values.size()) + " numbers, next slot " +
                std::to_string(next) + ", does not fit one of " + std::to_string(capacity_) +
                " transitions of " + std::to_string(stride_) +
                " numbers: restore it with the settings it was saved with.");
  }
  values_.assign(values.begin(), values.end());
  size_ = size;
  next_ = next;
}

}  // namespace pmeta
