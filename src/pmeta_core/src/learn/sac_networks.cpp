#include "pmeta_core/learn/sac_networks.h"

#include <string>
#include <utility>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

std::size_t taskInputs(const SacSettings& settings, int num_tasks) {
  if (settings.task_encoding == "none") return 0;
  if (settings.task_encoding == "inference") {
    return static_cast<std::size_t>(settings.context.latent_size);
  }
  if (num_tasks < 1) throw Error("a one-hot task input needs the number of tasks, at least one.");
  return static_cast<std::size_t>(num_tasks);
}

const EnvSpec& requireContinuous(const EnvSpec& env) {
  if (env.num_actions > 0) {
    throw Error("environment '" + env.name +
                "' has discrete actions: soft actor-critic needs continuous ones.");
  }
  return env;
}

MlpSpec network(const char* prefix, const SacSettings& settings, std::size_t inputs,
                std::size_t outputs) {
  MlpSpec spec;
  spec.prefix = prefix;
  spec.inputs = inputs;
  spec.hidden.assign(settings.hidden.begin(), settings.hidden.end());
  spec.outputs = outputs;
  spec.portable = settings.portable;
  return spec;
}

}  // namespace

std::vector<float> oneHot(int task, int num_tasks) {
  if (task < 0 || task >= num_tasks) {
    throw Error("task " + std::to_string(task) + " is none of " + std::to_string(num_tasks) + ".");
  }
  std::vector<float> vector(static_cast<std::size_t>(num_tasks));
  vector[static_cast<std::size_t>(task)] = 1;
  return vector;
}

SacNetworks::SacNetworks(const EnvSpec& env, const SacSettings& settings, int num_tasks)
    : observation_size_(static_cast<std::size_t>(requireContinuous(env).observation_size)),
      action_size_(static_cast<std::size_t>(env.action_size)),
      task_input_size_(taskInputs(settings, num_tasks)),
      actor_(network("actor", settings, observation_size_ + task_input_size_, 2 * action_size_)),
      critic1_(
          network("critic1", settings, observation_size_ + task_input_size_ + action_size_, 1)),
      critic2_(network("critic2", settings, critic1_.inputs(), 1)) {
  if (settings.task_encoding == "inference") {
    encoder_.emplace(env.observation_size, env.action_size, settings.context);
  }
}

std::size_t SacNetworks::size() const {
  return encoderOffset() + (hasEncoder() ? encoder_->network().size() : 0);
}

std::vector<Block> SacNetworks::blocks() const {
  std::vector<Block> all;
  const auto append = [&](const Mlp& mlp) {
    all.insert(all.end(), mlp.blocks().begin(), mlp.blocks().end());
  };
  append(actor_);
  append(critic1_);
  append(critic2_);
  if (hasEncoder()) append(encoder_->network());
  return all;
}

void SacNetworks::initialise(float* parameters, Rng& rng) const {
  actor_.initialise(parameters, rng);
  for (int k = 0; k < 2; ++k) critic(k).initialise(parameters + criticOffset(k), rng);
  if (hasEncoder()) encoder_->network().initialise(parameters + encoderOffset(), rng);
}

SacPolicies::SacPolicies(const EnvSpec& env, const SacSettings& settings, int num_tasks)
    : PolicyFamily(
          ModelLayout(Precision::kFloat32, SacNetworks(env, settings, num_tasks).blocks())),
      networks_(env, settings, num_tasks) {}

void SacPolicies::initialise(Model& parameters, Rng& rng) const {
  networks_.initialise(parameters.floats().data(), rng);
}

std::unique_ptr<Actor> SacPolicies::actor(const Model& parameters, std::vector<float> task_input,
                                          std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.actor(), std::move(task_input), max_batch,
                                         GaussianActor::By::kMean, parameters.floats().data());
}

}  // namespace pmeta
