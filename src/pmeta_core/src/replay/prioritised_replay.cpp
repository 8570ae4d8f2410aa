#include "pmeta_core/replay/prioritised_replay.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

// keeps every transition reachable, however well it is predicted
constexpr double kLeastPriority = 1e-6;
constexpr double kMostPriority = 1e39;  // above any float

}  // namespace

PrioritisedReplay::PrioritisedReplay(std::size_t capacity, int observation_size, int action_size,
                                     double alpha, double beta)
    : buffer_(capacity, observation_size, action_size),
      tree_(capacity),
      alpha_(alpha),
      beta_(beta) {}

void PrioritisedReplay::add(const Transition& transition) {
  tree_.set(buffer_.add(transition), std::pow(max_priority_, alpha_));
}

void PrioritisedReplay::sample(int batch_size, Rng& rng, ReplayBatch& batch) const {
  const auto n = static_cast<std::size_t>(batch_size);
  const auto observation_size = static_cast<std::size_t>(buffer_.observationSize());
  const auto action_size = static_cast<std::size_t>(buffer_.actionSize());
  batch.slots.resize(n);
  batch.observations.resize(n * observation_size);
  batch.actions.resize(n * action_size);
  batch.rewards.resize(n);
  batch.discounts.resize(n);
  batch.next_observations.resize(n * observation_size);
  batch.weights.resize(n);

  const double scale = static_cast<double>(size()) / tree_.total();
  float largest = 0;
  for (std::size_t b = 0; b < n; ++b) {
    const std::size_t slot = tree_.find(rng.uniform() * tree_.total());
    const Transition transition = buffer_[slot];
    batch.slots[b] = slot;
    std::copy_n(transition.observation, observation_size,
                &batch.observations[b * observation_size]);
    std::copy_n(transition.action, action_size, &batch.actions[b * action_size]);
    batch.rewards[b] = transition.reward;
    batch.discounts[b] = transition.discount;
    std::copy_n(transition.next_observation, observation_size,
                &batch.next_observations[b * observation_size]);
    batch.weights[b] = static_cast<float>(std::pow(scale * tree_.get(slot), -beta_));
    largest = std::max(largest, batch.weights[b]);
  }
  for (float& weight : batch.weights) weight /= largest;
}

void PrioritisedReplay::setPriorities(const ReplayBatch& batch, const float* td_errors) {
  if (alpha_ == 0) return;
  for (std::size_t b = 0; b < batch.slots.size(); ++b) {
    const double priority = std::abs(static_cast<double>(td_errors[b])) + kLeastPriority;
    max_priority_ = std::max(max_priority_, priority);
    tree_.set(batch.slots[b], std::pow(priority, alpha_));
  }
}

void PrioritisedReplay::saveState(StateWriter& writer) const {
  writer.part("buffer", buffer_);
  tree_.saveState(writer, size());
  writer.value("max_priority", max_priority_);
}

void PrioritisedReplay::loadState(StateReader& reader) {
  reader.part("buffer", buffer_);
  tree_.loadState(reader, size());
  max_priority_ = reader.finite("max_priority");
  if (max_priority_ < 1 || max_priority_ > kMostPriority) {
    reader.refuse("max_priority", "is " + formatNumber(max_priority_) + ", which is none");
  }
}

}  // namespace pmeta
