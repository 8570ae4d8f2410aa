#include "pmeta_core/learn/context_adaptation.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/gaussian_policy.h"

namespace pmeta {
namespace {

// acts in one environment and keeps what it saw as context rows
class Explorer {
 public:
  Explorer(const SacNetworks& networks, bool noise, const float* parameters, Env& env)
      : networks_(networks),
        noise_(noise),
        parameters_(parameters),
        env_(env),
        workspace_(networks, 1),
        policy_(networks.actionSize(), 1),
        observation_(networks.observationSize()),
        action_(networks.actionSize()) {}

  // one episode with that z; false if it broke down
  bool run(const std::vector<float>& z, Rng& rng) {
    try {
      Step step;
      env_.reset(rng, observation_.data());
      seen_.assign(observation_.begin(), observation_.end());
      while (!step.terminated && !step.truncated) {
        act(z, rng);
        step = env_.step(action_.data(), rng, observation_.data());
        keep(step);
      }
      return true;
    } catch (const BrokenEpisode&) {
      return false;
    }
  }

  const std::vector<float>& context() const { return context_; }
  std::size_t rows() const { return context_.size() / networks_.encoder().rowSize(); }

 private:
  void act(const std::vector<float>& z, Rng& rng) {
    const float* heads = networks_.heads(parameters_, seen_.data(), 1, z.data(), workspace_);
    if (!noise_) {
      meanActions(heads, 1, action_.size(), action_.data());
      return;
    }
    policy_.sample(heads, 1, rng);
    std::copy_n(policy_.actions(), action_.size(), action_.begin());
  }

  void keep(const Step& step) {
    const std::vector<float> action(action_.begin(), action_.end());
    const std::vector<float> next(observation_.begin(), observation_.end());
    context_.resize(context_.size() + networks_.encoder().rowSize());
    networks_.encoder().writeRow(
        {seen_.data(), action.data(), static_cast<float>(step.evaluatedReward()), 0, next.data()},
        &context_[context_.size() - networks_.encoder().rowSize()]);
    seen_ = next;
  }

  const SacNetworks& networks_;
  bool noise_;
  const float* parameters_;
  Env& env_;
  SacNetworks::ActorWorkspace workspace_;
  GaussianPolicy policy_;
  std::vector<double> observation_, action_;
  std::vector<float> seen_;  // the observation as the networks see it
  std::vector<float> context_;
};

}  // namespace

std::vector<Adaptation> adapt(const SacNetworks& networks, const ContextSettings& settings,
                              const float* parameters, Env& env, Rng& rng) {
  if (!networks.hasEncoder()) {
    throw Error("adapting to a task needs the context encoder: set task_encoding to inference.");
  }
  const ContextEncoder& encoder = networks.encoder();
  ContextEncoder::Workspace workspace(encoder, static_cast<std::size_t>(settings.batch_size));
  Explorer explorer(networks, settings.exploration_noise, parameters, env);
  LatentPosterior posterior;
  std::vector<Adaptation> known;
  std::vector<float> z(encoder.latentSize());
  int broken = 0;  // since the last entry
  const std::vector<int>& counts = settings.exploration_episodes;
  for (int episode = 0;; ++episode) {
    encoder.infer(parameters + networks.encoderOffset(), explorer.context().data(), explorer.rows(),
                  workspace, posterior);
    if (std::count(counts.begin(), counts.end(), episode) > 0) {
      known.push_back({episode, {posterior.mean.begin(), posterior.mean.end()}, broken});
      broken = 0;
    }
    if (counts.empty() || episode >= counts.back()) return known;
    for (std::size_t j = 0; j < z.size(); ++j) {
      z[j] =
          static_cast<float>(posterior.mean[j] + std::sqrt(posterior.variance[j]) * rng.normal());
    }
    if (!explorer.run(z, rng)) ++broken;
  }
}

}  // namespace pmeta
