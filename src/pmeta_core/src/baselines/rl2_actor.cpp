#include "pmeta_core/baselines/rl2_actor.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pmeta {

TrialMemory::TrialMemory(const Rl2Networks& networks)
    : hidden(networks.gru().units()), last(networks.lastSize()) {}

Rl2Actor::Rl2Actor(const Rl2Networks& networks, const float* parameters, std::size_t max_batch,
                   By by)
    : networks_(networks),
      parameters_(parameters),
      by_(by),
      memories_(max_batch, TrialMemory(networks)),
      row_of_env_(max_batch),
      input_(max_batch * networks.gru().inputs()),
      hidden_(max_batch * networks.gru().units()),
      recurrent_(networks.gru(), max_batch, max_batch),
      head_(networks.mean(), max_batch) {}

Rl2Actor::Rl2Actor(const Rl2Networks& networks, const float* parameters, std::size_t max_batch,
                   TrialMemory start)
    : Rl2Actor(networks, parameters, max_batch, By::kMean) {
  start_ = std::move(start);
}

void Rl2Actor::forget() {
  for (TrialMemory& memory : memories_) {
    std::fill(memory.hidden.begin(), memory.hidden.end(), 0.0f);
    std::fill(memory.last.begin(), memory.last.end(), 0.0f);
    memory.begun = false;
  }
}

void Rl2Actor::begin(std::size_t env, Rng&) {
  TrialMemory& memory = memories_[env];
  if (start_) memory = *start_;
  if (memory.begun) memory.last.back() = 1;
}

void Rl2Actor::look(const float* observations, const std::vector<std::size_t>& envs) {
  const std::size_t size = networks_.observationSize(), units = networks_.gru().units();
  float* row = input_.data();
  for (std::size_t b = 0; b < envs.size(); ++b) {
    const TrialMemory& memory = memories_[envs[b]];
    row_of_env_[envs[b]] = b;
    row = std::copy_n(observations + b * size, size, row);
    row = std::copy(memory.last.begin(), memory.last.end(), row);
    std::copy(memory.hidden.begin(), memory.hidden.end(), &hidden_[b * units]);
  }
  networks_.gru().step(parameters_, input_.data(), envs.size(), hidden_.data(), recurrent_);
  means_ = networks_.mean().forward(parameters_ + networks_.meanOffset(), hidden_.data(),
                                    envs.size(), head_);
}

bool Rl2Actor::act(std::size_t row, Rng& rng, double* action) {
  const std::size_t n = networks_.actionSize();
  const float* log_std = parameters_ + networks_.logStdOffset();
  for (std::size_t j = 0; j < n; ++j) {
    // in single precision, as it is learnt from
    float u = means_[row * n + j];
    if (by_ == By::kSample) {
      const double std = std::exp(std::max<double>(log_std[j], kLowestLogStd));
      u += static_cast<float>(std * rng.normal());
    }
    action[j] = u;
  }
  return true;
}

void Rl2Actor::observe(const Experience& e) {
  const std::size_t units = networks_.gru().units(), n = networks_.actionSize();
  TrialMemory& memory = memories_[e.env];
  std::copy_n(&hidden_[row_of_env_[e.env] * units], units, memory.hidden.begin());
  std::copy_n(e.action, n, memory.last.begin());
  memory.last[n] = static_cast<float>(e.step.evaluatedReward());
  memory.last[n + 1] = 0;
  memory.begun = true;
}

Rl2Adaptation::Rl2Adaptation(const Rl2Networks& networks, const float* parameters)
    : networks_(networks),
      parameters_(parameters),
      acting_(networks, parameters, 1, Rl2Actor::By::kMean) {}

std::unique_ptr<Actor> Rl2Adaptation::adapted(std::size_t max_batch) const {
  return std::make_unique<Rl2Actor>(networks_, parameters_, max_batch, memory());
}

}  // namespace pmeta
