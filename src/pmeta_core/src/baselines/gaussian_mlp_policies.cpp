#include "pmeta_core/baselines/gaussian_mlp_policies.h"

#include <algorithm>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

GaussianMlp networkFor(const EnvSpec& env, const std::vector<int>& hidden) {
  if (env.num_actions > 0) {
    throw Error("environment '" + env.name +
                "' has discrete actions: a Gaussian policy needs continuous ones.");
  }
  return {static_cast<std::size_t>(env.observation_size), hidden,
          static_cast<std::size_t>(env.action_size)};
}

}  // namespace

GaussianMlpActor::GaussianMlpActor(const GaussianMlp& policy, double scale,
                                   std::vector<double> parameters, std::size_t max_batch)
    : policy_(policy), scale_(scale), parameters_(std::move(parameters)), u_(policy.actions()) {
  observations_.reserve(max_batch * policy.inputs());
}

void GaussianMlpActor::look(const float* observations, const std::vector<std::size_t>& envs) {
  observations_.assign(observations, observations + envs.size() * policy_.inputs());
  policy_.forward(parameters_.data(), observations_.data(), envs.size(), pass_);
}

bool GaussianMlpActor::act(std::size_t row, Rng& rng, double* action) {
  draw(&pass_.mean()[row * u_.size()], rng, u_.data());
  for (std::size_t j = 0; j < u_.size(); ++j) action[j] = std::clamp(u_[j] / scale_, -1.0, 1.0);
  return true;
}

void GaussianMlpActor::draw(const double* mean, Rng&, double* u) {
  std::copy_n(mean, u_.size(), u);
}

GaussianMlpPolicies::GaussianMlpPolicies(const EnvSpec& env, const std::vector<int>& hidden,
                                         double log_std, double scale)
    : PolicyFamily(ModelLayout(Precision::kFloat64, networkFor(env, hidden).blocks())),
      network_(networkFor(env, hidden)),
      log_std_(log_std),
      scale_(scale) {}

PolicyForm GaussianMlpPolicies::form() const {
  const std::string scaling = scale_ == 1 ? "" : "divided by " + formatNumber(scale_) + ", ";
  return {"tanh", "none", "policy", "none", scaling + "clipped to [-1, 1]"};
}

void GaussianMlpPolicies::initialise(Model& parameters, Rng& rng) const {
  network_.initialise(parameters.doubles().data(), log_std_, rng);
}

std::unique_ptr<Actor> GaussianMlpPolicies::actor(const Model& parameters, std::vector<float>,
                                                  std::size_t max_batch) const {
  return std::make_unique<GaussianMlpActor>(network_, scale_, parameters.doubles(), max_batch);
}

}  // namespace pmeta
