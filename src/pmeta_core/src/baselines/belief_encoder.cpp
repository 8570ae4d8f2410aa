#include "pmeta_core/baselines/belief_encoder.h"

#include <algorithm>
#include <numeric>

#include "pmeta_core/nn/initialisation.h"

namespace pmeta {
namespace {

constexpr float kLeastVariance = 1e-4f;

GruSpec recurrent(const EnvSpec& env, const MetaCureSettings& settings) {
  return {"encoder", static_cast<std::size_t>(env.observation_size + env.action_size + 1),
          static_cast<std::size_t>(settings.recurrent_units), settings.sac.portable};
}

MlpSpec head(const MetaCureSettings& settings) {
  return mlpSpec("encoder_head", static_cast<std::size_t>(settings.recurrent_units), {},
                 2 * static_cast<std::size_t>(settings.latent_size), settings.sac.portable);
}

float variance(float raw) {
  return std::max(std::max(raw, 0.0f) + std::log1p(std::exp(-std::abs(raw))), kLeastVariance);
}

// derivative by what softplus was taken of
float varianceSlope(float variance) {
  return variance > kLeastVariance ? -std::expm1(-variance) : 0;
}

}  // namespace

BeliefEncoder::BeliefEncoder(const EnvSpec& env, const MetaCureSettings& settings)
    : observation_size_(static_cast<std::size_t>(env.observation_size)),
      gru_(recurrent(env, settings)),
      head_(head(settings)) {}

std::vector<Block> BeliefEncoder::blocks() const {
  std::vector<Block> all = gru_.blocks();
  all.insert(all.end(), head_.blocks().begin(), head_.blocks().end());
  return all;
}

void BeliefEncoder::initialise(float* parameters, Rng& rng) const {
  pmeta::initialise(blocks(), Initialisation::kOrthogonal, parameters, rng);
}

void BeliefEncoder::toBeliefs(const float* outputs, std::size_t rows, float* beliefs) const {
  const std::size_t latent = latentSize();
  for (std::size_t r = 0; r < rows; ++r) {
    beliefs = std::copy_n(outputs, latent, beliefs);
    beliefs = std::transform(outputs + latent, outputs + 2 * latent, beliefs, variance);
    outputs += 2 * latent;
  }
}

void BeliefEncoder::step(const float* parameters, const float* token, float* hidden, float* belief,
                         Workspace& workspace) const {
  gru_.step(parameters, token, 1, hidden, workspace.recurrent);
  toBeliefs(head_.forward(parameters + gru_.size(), hidden, 1, workspace.head), 1, belief);
}

void addBeliefGradient(const float* belief, std::size_t latent_size, const float* noise,
                       const float* d_z, float kl_weight, float* d_belief) {
  for (std::size_t i = 0; i < latent_size; ++i) {
    const float mean = belief[i], variance = belief[latent_size + i];
    d_belief[i] += d_z[i] + kl_weight * mean;
    d_belief[latent_size + i] +=
        0.5f * (d_z[i] * noise[i] / std::sqrt(variance) + kl_weight * (1 - 1 / variance));
  }
}

TrialBeliefs::TrialBeliefs(const BeliefEncoder& encoder, std::size_t max_trials,
                           std::size_t max_steps)
    : encoder_(encoder),
      recurrent_(encoder.gru_, max_trials * (max_steps + 1), max_trials),
      head_(encoder.head_, max_trials * (max_steps + 1)) {
  const std::size_t rows = max_trials * (max_steps + 1);
  tokens_.resize(rows * encoder.tokenSize());
  for (AlignedFloats* beliefs : {&beliefs_, &d_beliefs_}) {
    beliefs->resize(rows * encoder.beliefSize());
  }
  d_hidden_.resize(rows * encoder.units());
}

void TrialBeliefs::infer(const float* parameters, const std::vector<StoredTrial>& trials) {
  order_.resize(trials.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
    return trials[a].steps() > trials[b].steps();
  });
  rank_.resize(trials.size());
  batches_.assign(trials[order_.front()].steps() + 1, 0);
  for (std::size_t k = 0; k < order_.size(); ++k) {
    rank_[order_[k]] = k;
    for (std::size_t t = 0; t <= trials[order_[k]].steps(); ++t) ++batches_[t];
  }
  first_rows_.resize(batches_.size());
  rows_ = 0;
  for (std::size_t t = 0; t < batches_.size(); ++t) {
    first_rows_[t] = rows_;
    rows_ += batches_[t];
  }
  for (std::size_t k = 0; k < trials.size(); ++k) writeTokens(trials[k], k);

  hidden_ = encoder_.gru_.unroll(parameters, tokens_.data(), batches_, nullptr, recurrent_);
  encoder_.toBeliefs(
      encoder_.head_.forward(parameters + encoder_.gru_.size(), hidden_, rows_, head_), rows_,
      beliefs_.data());
  std::fill(d_beliefs_.begin(), d_beliefs_.end(), 0.0f);
}

void TrialBeliefs::writeTokens(const StoredTrial& trial, std::size_t k) {
  const std::size_t actions = encoder_.actionSize();
  for (std::size_t t = 0; t <= trial.steps(); ++t) {
    float* token = &tokens_[(first_rows_[t] + rank_[k]) * encoder_.tokenSize()];
    token = std::copy_n(trial.place(t), encoder_.observationSize(), token);
    if (t == 0) {
      std::fill_n(token, actions + 1, 0.0f);
    } else {
      const TrialStep last = trial[t - 1];
      *std::copy_n(last.action, actions, token) = last.evaluated_reward;
    }
  }
}

void TrialBeliefs::backward(const float* parameters, float* gradient) {
  const std::size_t latent = encoder_.latentSize();
  for (std::size_t r = 0; r < rows_; ++r) {
    const std::size_t variances = (2 * r + 1) * latent;
    for (std::size_t i = variances; i < variances + latent; ++i) {
      d_beliefs_[i] *= varianceSlope(beliefs_[i]);
    }
  }
  const std::size_t head = encoder_.gru_.size();
  encoder_.head_.backward(parameters + head, hidden_, rows_, d_beliefs_.data(), gradient + head,
                          d_hidden_.data(), head_);
  encoder_.gru_.backward(parameters, tokens_.data(), d_hidden_.data(), gradient, nullptr, nullptr,
                         recurrent_);
}

}  // namespace pmeta
