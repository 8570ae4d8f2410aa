#include "pmeta_core/learn/sac_networks.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "pmeta_core/act/gaussian_actor.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

std::size_t taskInputs(const SacSettings& settings, int num_tasks) {
  if (settings.task_encoding == "none") return 0;
  if (settings.infers()) {
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

MlpSpec network(const char* name, const SacSettings& settings, std::size_t inputs,
                std::size_t outputs) {
  return mlpSpec(settings.prefix + name, inputs, settings.hidden, outputs, settings.portable);
}

// of the actor and the critics, all of which have the task input after the observation
MlpSpec withHeads(MlpSpec spec, const EnvSpec& env, const SacSettings& settings, int num_tasks) {
  if (!settings.hasHeads()) return spec;
  spec.heads = static_cast<std::size_t>(num_tasks);
  spec.head_input = static_cast<std::size_t>(env.observation_size);
  return spec;
}

void initialiseAsRlkit(const Mlp& network, float* parameters, double last, Rng& rng) {
  const std::vector<Block>& blocks = network.blocks();
  for (std::size_t l = 0; l < blocks.size(); l += 2) {
    const Block &weight = blocks[l], &bias = blocks[l + 1];
    const bool is_last = l + 2 == blocks.size();
    const double bound = is_last ? last : 1 / std::sqrt(static_cast<double>(weight.shape[0]));
    const std::size_t drawn = weight.size() + (is_last ? bias.size() : 0);
    for (std::size_t k = 0; k < drawn; ++k) {
      *parameters++ = static_cast<float>(bound * (2 * rng.uniform() - 1));
    }
    if (!is_last) parameters = std::fill_n(parameters, bias.size(), 0.1f);
  }
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
      min_log_std_(static_cast<float>(settings.min_log_std)),
      as_rlkit_(settings.initialisation == "rlkit"),
      actor_(withHeads(
          network("actor", settings, observation_size_ + task_input_size_, 2 * action_size_), env,
          settings, num_tasks)),
      critic1_(withHeads(network("critic1", settings, actor_.inputs() + action_size_, 1), env,
                         settings, num_tasks)),
      critic2_(
          withHeads(network("critic2", settings, critic1_.inputs(), 1), env, settings, num_tasks)) {
  if (settings.backbone == "value") {
    value_.emplace(network("value", settings, actor_.inputs(), 1));
  }
  if (settings.infers()) {
    encoder_.emplace(env.observation_size, env.action_size, settings.context);
  }
  if (settings.models()) {
    task_model_.emplace(env.observation_size, env.action_size, task_input_size_,
                        settings.task_model, settings.portable);
  }
}

std::size_t SacNetworks::size() const {
  return encoderOffset() + (hasEncoder() ? encoder_->network().size() : 0) +
         (hasTaskModel() ? task_model_->size() : 0);
}

std::vector<Block> SacNetworks::blocks() const {
  std::vector<Block> all;
  const auto append = [&](const Mlp& mlp) {
    all.insert(all.end(), mlp.blocks().begin(), mlp.blocks().end());
  };
  append(actor_);
  append(critic1_);
  append(critic2_);
  if (hasValue()) append(*value_);
  if (hasEncoder()) append(encoder_->network());
  if (hasTaskModel()) {
    const std::vector<Block> model = task_model_->blocks();
    all.insert(all.end(), model.begin(), model.end());
  }
  return all;
}

std::vector<std::size_t> SacNetworks::taskWeights() const {
  std::vector<std::size_t> all;
  const auto append = [&](const Mlp& mlp, std::size_t offset, std::size_t column) {
    // the first block is the first layer's weight, [outputs, inputs]
    for (std::size_t o = 0; o < mlp.blocks().front().shape[0]; ++o) {
      all.push_back(offset + o * mlp.inputs() + column);
    }
  };
  append(actor_, 0, observation_size_);
  for (int k = 0; k < 2; ++k) append(critic(k), criticOffset(k), observation_size_);
  if (hasTaskModel()) append(task_model_->network(), taskModelOffset(), task_model_->rowSize());
  return all;
}

void SacNetworks::initialise(float* parameters, Rng& rng) const {
  const auto draw = [&](const Mlp& network, std::size_t offset, double last) {
    if (as_rlkit_) {
      initialiseAsRlkit(network, parameters + offset, last, rng);
    } else {
      network.initialise(parameters + offset, rng);
    }
  };
  draw(actor_, 0, 1e-3);
  for (int k = 0; k < 2; ++k) draw(critic(k), criticOffset(k), 3e-3);
  if (hasValue()) draw(*value_, valueOffset(), 3e-3);
  if (hasEncoder()) draw(encoder_->network(), encoderOffset(), 3e-3);
  if (!hasTaskModel()) return;
  task_model_->initialise(parameters + taskModelOffset(), rng);
  for (const std::size_t weights : taskWeights()) {
    std::fill_n(parameters + weights, task_input_size_, 0.0f);
  }
}

SacPolicies::SacPolicies(const EnvSpec& env, const SacSettings& settings, int num_tasks)
    : PolicyFamily(
          ModelLayout(Precision::kFloat32, SacNetworks(env, settings, num_tasks).blocks())),
      networks_(env, settings, num_tasks) {}

PolicyForm SacPolicies::form() const {
  const MlpSpec& actor = networks_.actor().spec();
  return {"relu", "tanh", actor.prefix, "none", "none", actor.heads};
}

void SacPolicies::initialise(Model& parameters, Rng& rng) const {
  networks_.initialise(parameters.floats().data(), rng);
}

std::unique_ptr<Actor> SacPolicies::actor(const Model& parameters, std::vector<float> task_input,
                                          std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.actor(), std::move(task_input), max_batch,
                                         GaussianActor::By::kMean, parameters.floats().data());
}

}  // namespace pmeta
