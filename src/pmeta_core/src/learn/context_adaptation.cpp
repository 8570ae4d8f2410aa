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

  // return of one episode with that z
  double run(const std::vector<float>& z, Rng& rng) {
    double total = 0;
    Step step;
    env_.reset(rng, observation_.data());
    seen_.assign(observation_.begin(), observation_.end());
    while (!step.terminated && !step.truncated) {
      act(z, rng);
      step = env_.step(action_.data(), rng, observation_.data());
      total += step.evaluatedReward();
      keep(step);
    }
    return total;
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

Adaptation adapt(const SacNetworks& networks, const ContextSettings& settings,
                 const float* parameters, Env& env, Rng& rng) {
  if (!networks.hasEncoder()) {
    throw Error("adapting to a task needs the context encoder: set task_encoding to inference.");
  }
  const ContextEncoder& encoder = networks.encoder();
  ContextEncoder::Workspace workspace(encoder, static_cast<std::size_t>(settings.batch_size));
  Explorer explorer(networks, settings.exploration_noise, parameters, env);
  Adaptation result;
  result.before.assign(encoder.latentSize(), 0.0f);
  std::vector<float> z(encoder.latentSize());
  for (int episode = 0; episode <= settings.exploration_episodes; ++episode) {
    encoder.infer(parameters + networks.encoderOffset(), explorer.context().data(), explorer.rows(),
                  workspace, result.posterior);
    if (episode == settings.exploration_episodes) break;
    for (std::size_t j = 0; j < z.size(); ++j) {
      z[j] = static_cast<float>(result.posterior.mean[j] +
                                std::sqrt(result.posterior.variance[j]) * rng.normal());
    }
    result.returns.push_back(explorer.run(z, rng));
  }
  result.after.assign(result.posterior.mean.begin(), result.posterior.mean.end());
  result.env_steps = static_cast<std::int64_t>(explorer.rows());
  return result;
}

}  // namespace pmeta
