#include "pmeta_core/learn/context_encoder.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr double kLeastVariance = 1e-7;

double softplus(double x) { return std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x))); }

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

double factorVariance(double x) { return std::max(softplus(x), kLeastVariance); }

MlpSpec encoderNetwork(std::size_t inputs, const ContextSettings& settings) {
  return mlpSpec("encoder", inputs, settings.hidden,
                 2 * static_cast<std::size_t>(settings.latent_size), settings.portable);
}

}  // namespace

void bind(Settings& s, const std::string& prefix, ContextSettings& c) {
  bindEncoder(s, prefix, c);
  s.bind(prefix + "context_buffer", c.buffer_size, "recent context transitions kept",
         Range::between(1, 1e9));
  s.bind(prefix + "context_window", c.window,
         "transitions in a row that one training context is drawn from, such as an episode's; 0: "
         "all that are kept",
         Range::between(0, 1e9));
  s.bind(prefix + "contexts_per_update", c.per_update,
         "contexts of one update, each giving its z to an equal part of the batch",
         Range::between(1, 1e6));
  s.bind(prefix + "prior_interval", c.prior_interval,
         "every how-many-th training episode acts on z from the prior and becomes context",
         Range::between(1, 1e6));
  s.bind(prefix + "context_explorer", c.explorer,
         "who acts on z from the prior: meta (the meta-policy, as at test time) or personal",
         {"meta", "personal"});
}

void bindEncoder(Settings& s, const std::string& prefix, ContextSettings& c) {
  s.bind(prefix + "context_hidden", c.hidden, "units of each hidden layer of the context encoder",
         Range::between(1, 65536));
  s.bind(prefix + "latent_size", c.latent_size, "length of the task vector z",
         Range::between(1, 1000));
  s.bind(prefix + "context_batch", c.batch_size,
         "transitions of one context, from which one z is inferred", Range::between(1, 1e6));
  s.bind(prefix + "context_symlog", c.symlog,
         "the encoder sees sign(x) ln(1 + |x|) of every number in a context");
  s.bind(prefix + "kl_weight", c.kl_weight, "weight of the divergence of q(z|c) from the prior",
         Range::atLeast(0));
  s.bind(prefix + "context_next_observation", c.next_observation,
         "contexts hold next observations; for tasks that differ in dynamics");
  s.bind(prefix + "context_posterior", c.posterior_episodes,
         "training episodes on z from q(z|c), too, become context");
  s.bind(prefix + "exploration_episodes", c.exploration_episodes,
         "episodes at test time before z is fixed", Range::between(1, 1000));
  s.bind(prefix + "exploration_noise", c.exploration_noise,
         "these act by samples of the policy instead of its mean");
  s.bind(prefix + "exploration_prior", c.exploration_prior,
         "all of these, not only the first, act on z from the prior");
}

void check(const ContextSettings& context, const std::string& prefix) {
  const std::vector<int>& counts = context.exploration_episodes;
  if (std::adjacent_find(counts.begin(), counts.end(), std::greater_equal<int>()) != counts.end()) {
    throw Error(prefix + "exploration_episodes must be ascending, e.g. [5, 15].");
  }
}

double klToPrior(const LatentPosterior& posterior) {
  double sum = 0;
  for (std::size_t j = 0; j < posterior.mean.size(); ++j) {
    const double mean = posterior.mean[j], variance = posterior.variance[j];
    sum += (variance + mean * mean - 1 - std::log(variance)) / 2;
  }
  return sum;
}

void drawLatent(const LatentPosterior& posterior, Rng& rng, double* noise, float* z) {
  for (std::size_t j = 0; j < posterior.mean.size(); ++j) {
    noise[j] = rng.normal();
    z[j] = static_cast<float>(posterior.mean[j] + std::sqrt(posterior.variance[j]) * noise[j]);
  }
}

ContextEncoder::Workspace::Workspace(const ContextEncoder& encoder, std::size_t max_rows)
    : mlp(encoder.network(), max_rows),
      heads(max_rows * encoder.network().outputs()),
      d_heads(heads),
      precision(encoder.latentSize()),
      weighted(encoder.latentSize()) {}

ContextEncoder::ContextEncoder(int observation_size, int action_size,
                               const ContextSettings& settings)
    : observation_size_(observation_size),
      action_size_(action_size),
      next_observation_(settings.next_observation),
      symlog_(settings.symlog),
      latent_size_(static_cast<std::size_t>(settings.latent_size)),
      network_(encoderNetwork(static_cast<std::size_t>(
                                  observation_size * (next_observation_ ? 2 : 1) + action_size + 1),
                              settings)) {}

void ContextEncoder::writeRow(const Transition& transition, float* row) const {
  float* end = std::copy_n(transition.observation, observation_size_, row);
  end = std::copy_n(transition.action, action_size_, end);
  *end++ = transition.reward;
  if (next_observation_) end = std::copy_n(transition.next_observation, observation_size_, end);
  if (!symlog_) return;
  for (; row < end; ++row) *row = std::copysign(std::log1p(std::abs(*row)), *row);
}

void ContextEncoder::infer(const float* parameters, const float* context, std::size_t rows,
                           Workspace& workspace, LatentPosterior& posterior) const {
  posterior.mean.assign(latent_size_, 0.0);
  posterior.variance.assign(latent_size_, 1.0);
  if (rows == 0) return;
  std::vector<double>&precision = workspace.precision, &weighted = workspace.weighted;
  std::fill(precision.begin(), precision.end(), 0.0);
  std::fill(weighted.begin(), weighted.end(), 0.0);
  for (std::size_t first = 0; first < rows; first += workspace.mlp.maxBatch()) {
    const std::size_t n = std::min(rows - first, workspace.mlp.maxBatch());
    const float* heads =
        network_.forward(parameters, context + first * rowSize(), n, workspace.mlp);
    std::copy_n(heads, n * 2 * latent_size_, workspace.heads.begin());
    for (std::size_t i = 0; i < n; ++i, heads += 2 * latent_size_) {
      for (std::size_t j = 0; j < latent_size_; ++j) {
        const double factor = 1 / factorVariance(heads[latent_size_ + j]);
        precision[j] += factor;
        weighted[j] += factor * heads[j];
      }
    }
  }
  for (std::size_t j = 0; j < latent_size_; ++j) {
    posterior.variance[j] = 1 / precision[j];
    posterior.mean[j] = weighted[j] / precision[j];
  }
}

void ContextEncoder::backward(const float* parameters, const float* context, std::size_t rows,
                              const LatentPosterior& posterior, const double* noise,
                              const float* d_z, double kl_weight, Workspace& workspace,
                              float* gradient) const {
  if (rows == 0 || rows > workspace.mlp.maxBatch()) {
    throw Error("a context of " + std::to_string(rows) +
                " transitions has no gradient in a workspace of " +
                std::to_string(workspace.mlp.maxBatch()) + ": give one that holds them.");
  }
  for (std::size_t j = 0; j < latent_size_; ++j) {
    const double mean = posterior.mean[j], variance = posterior.variance[j];
    const double d_mean = d_z[j] + kl_weight * mean;
    const double d_variance =
        d_z[j] * noise[j] / (2 * std::sqrt(variance)) + kl_weight * (1 - 1 / variance) / 2;
    for (std::size_t i = 0; i < rows; ++i) {
      const std::size_t at = 2 * i * latent_size_ + j;
      const double raw = workspace.heads[at + latent_size_];
      const double factor = 1 / factorVariance(raw);
      // by the factor's precision, then its variance, then what softplus is taken of
      const double d_precision =
          d_mean * variance * (workspace.heads[at] - mean) - d_variance * variance * variance;
      const double slope = softplus(raw) < kLeastVariance ? 0 : sigmoid(raw);
      workspace.d_heads[at] = static_cast<float>(d_mean * variance * factor);
      workspace.d_heads[at + latent_size_] =
          static_cast<float>(-d_precision * factor * factor * slope);
    }
  }
  network_.backward(parameters, context, rows, workspace.d_heads.data(), gradient, nullptr,
                    workspace.mlp);
}

}  // namespace pmeta
