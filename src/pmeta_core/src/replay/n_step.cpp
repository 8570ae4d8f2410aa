#include "pmeta_core/replay/n_step.h"

#include <algorithm>
#include <string>

namespace pmeta {

NStepAccumulator::NStepAccumulator(int num_envs, int n, double gamma, int observation_size,
                                   int action_size, bool bootstrap_at_limit)
    : n_(n),
      observation_size_(static_cast<std::size_t>(observation_size)),
      action_size_(static_cast<std::size_t>(action_size)),
      bootstrap_at_limit_(bootstrap_at_limit),
      powers_(static_cast<std::size_t>(n) + 1, 1.0),
      queues_(static_cast<std::size_t>(num_envs)) {
  for (std::size_t k = 1; k < powers_.size(); ++k) powers_[k] = powers_[k - 1] * gamma;
  for (Queue& queue : queues_) {
    queue.observations.resize(static_cast<std::size_t>(n) * observation_size_);
    queue.actions.resize(static_cast<std::size_t>(n) * action_size_);
    queue.returns.resize(static_cast<std::size_t>(n));
  }
}

void NStepAccumulator::add(int env, const float* observation, const float* action, const Step& step,
                           const float* next_observation, PrioritisedReplay& replay) {
  Queue& queue = queues_[static_cast<std::size_t>(env)];
  const auto newest = static_cast<std::size_t>(slot(queue, queue.size++));
  std::copy_n(observation, observation_size_, &queue.observations[newest * observation_size_]);
  std::copy_n(action, action_size_, &queue.actions[newest * action_size_]);
  queue.returns[newest] = 0;
  for (int age = 0; age < queue.size; ++age) {
    queue.returns[slot(queue, age)] += powers_[queue.size - 1 - age] * step.reward;
  }

  const bool ends = step.terminated || step.truncated;
  const bool bootstraps = !step.terminated && (!step.truncated || bootstrap_at_limit_);
  if (queue.size == n_) emitOldest(queue, bootstraps, next_observation, replay);
  while (ends && queue.size > 0) emitOldest(queue, bootstraps, next_observation, replay);
}

void NStepAccumulator::emitOldest(Queue& queue, bool bootstraps, const float* next_observation,
                                  PrioritisedReplay& replay) {
  const auto oldest = static_cast<std::size_t>(queue.first);
  replay.add({&queue.observations[oldest * observation_size_],
              &queue.actions[oldest * action_size_], static_cast<float>(queue.returns[oldest]),
              bootstraps ? static_cast<float>(powers_[queue.size]) : 0.0f, next_observation});
  queue.first = slot(queue, 1);
  --queue.size;
}

void NStepAccumulator::saveState(StateWriter& writer) const {
  for (std::size_t i = 0; i < queues_.size(); ++i) {
    writer.part("queue_" + std::to_string(i), queues_[i]);
  }
}

void NStepAccumulator::loadState(StateReader& reader) {
  for (std::size_t i = 0; i < queues_.size(); ++i) {
    reader.part("queue_" + std::to_string(i), queues_[i]);
  }
}

void NStepAccumulator::Queue::saveState(StateWriter& writer) const {
  writer.count("first", first);
  writer.count("size", size);
  writer.array("observations", observations);
  writer.array("actions", actions);
  writer.array("returns", returns);
}

void NStepAccumulator::Queue::loadState(StateReader& reader) {
  const auto last = static_cast<std::int64_t>(returns.size()) - 1;
  first = static_cast<int>(reader.count("first", 0, last));
  // the n-th step to wait completes the first
  size = static_cast<int>(reader.count("size", 0, last));
  reader.array("observations", observations);
  reader.array("actions", actions);
  reader.array("returns", returns);
}

}  // namespace pmeta
