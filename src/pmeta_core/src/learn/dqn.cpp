#include "pmeta_core/learn/dqn.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

int bestOf(const float* values, int n) {
  return static_cast<int>(std::max_element(values, values + n) - values);
}

}  // namespace

MlpSpec dqnNetwork(const EnvSpec& env, const DqnSettings& settings) {
  if (env.num_actions < 1) {
    throw Error("environment '" + env.name + "' has continuous actions: DQN needs discrete ones.");
  }
  MlpSpec spec;
  spec.prefix = "q";
  spec.inputs = static_cast<std::size_t>(env.observation_size);
  spec.hidden.assign(settings.hidden.begin(), settings.hidden.end());
  spec.outputs = static_cast<std::size_t>(env.num_actions);
  spec.dueling = settings.dueling;
  spec.portable = settings.portable;
  return spec;
}

void bind(Settings& s, const std::string& prefix, DqnSettings& d) {
  const Range positive = Range::between(1, 1e9);
  s.bind(prefix + "hidden", d.hidden, "units of each hidden layer", Range::between(1, 65536));
  s.bind(prefix + "batch_size", d.batch_size, "transitions of one update", Range::between(1, 1e6));
  s.bind(prefix + "buffer_size", d.buffer_size, "transitions the replay holds", positive);
  s.bind(prefix + "gamma", d.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "n_step", d.n_step, "rewards summed before bootstrapping",
         Range::between(1, 1000));
  s.bind(prefix + "double_q", d.double_q, "the online network chooses the action of the target");
  s.bind(prefix + "dueling", d.dueling, "state value and advantages apart");
  s.bind(prefix + "huber", d.huber, "Huber loss with threshold 1 instead of the square");
  s.bind(prefix + "target_update_interval", d.target_update_interval,
         "updates between copies to the target network", positive);
  s.bind(prefix + "averaged_targets", d.averaged_targets,
         "target networks whose mean is the target; 1: plain DQN", Range::between(1, 100));
  s.bind(prefix + "epsilon_start", d.epsilon_start, "exploration rate at the first update",
         Range::between(0, 1));
  s.bind(prefix + "epsilon_finish", d.epsilon_finish, "exploration rate at the end of its slope",
         Range::between(0, 1));
  s.bind(prefix + "epsilon_fraction", d.epsilon_fraction,
         "length of the slope as a share of all updates", Range::between(0, 1));
  s.bind(prefix + "num_envs", d.num_envs, "environments stepped in parallel",
         Range::between(1, 10000));
  s.bind(prefix + "env_steps_per_update", d.env_steps_per_update,
         "steps in each environment before an update", Range::between(1, 1e6));
  s.bind(prefix + "warm_up_steps", d.warm_up_steps,
         "random steps in each environment before the first update; at least n_step",
         Range::between(1, 1e6));
  s.bind(prefix + "bootstrap_at_limit", d.bootstrap_at_limit,
         "the horizon is no terminal state to the target");
  s.bind(prefix + "priority_alpha", d.priority_alpha, "how far priorities count; 0: uniform replay",
         Range::between(0, 1));
  s.bind(prefix + "priority_beta", d.priority_beta, "how far importance weights correct for that",
         Range::between(0, 1));
  s.bind(prefix + "evaluation_episodes", d.evaluation_episodes, "greedy episodes of one evaluation",
         Range::between(1, 100000));
}

DqnLearner::DqnLearner(std::vector<std::unique_ptr<Env>> envs, const DqnSettings& settings,
                       std::int64_t total_updates)
    : envs_(std::move(envs)),
      settings_(settings),
      observation_size_(envs_.front()->spec().observation_size),
      num_actions_(envs_.front()->spec().num_actions),
      epsilon_{settings.epsilon_start, settings.epsilon_finish,
               settings.epsilon_fraction * static_cast<double>(total_updates)},
      network_(dqnNetwork(envs_.front()->spec(), settings)),
      workspace_(network_, std::max(static_cast<std::size_t>(settings.batch_size), envs_.size())),
      replay_(static_cast<std::size_t>(settings.buffer_size), observation_size_, 1,
              settings.priority_alpha, settings.priority_beta),
      n_step_(static_cast<int>(envs_.size()), settings.n_step, settings.gamma, observation_size_, 1,
              settings.bootstrap_at_limit),
      targets_(static_cast<std::size_t>(settings.averaged_targets) * network_.size()),
      observations_(envs_.size() * static_cast<std::size_t>(observation_size_)),
      next_observation_(static_cast<std::size_t>(observation_size_)),
      next_observation_float_(static_cast<std::size_t>(observation_size_)),
      target_values_(static_cast<std::size_t>(settings.batch_size * num_actions_)),
      td_targets_(static_cast<std::size_t>(settings.batch_size)),
      td_errors_(static_cast<std::size_t>(settings.batch_size)),
      sample_gradient_(static_cast<std::size_t>(settings.batch_size)),
      output_gradient_(static_cast<std::size_t>(settings.batch_size * num_actions_)),
      gradient_(network_.size()) {
  if (settings.warm_up_steps < settings.n_step) {
    throw Error("dqn.warm_up_steps is " + std::to_string(settings.warm_up_steps) +
                " but dqn.n_step is " + std::to_string(settings.n_step) +
                ": nothing could be sampled; give at least as many.");
  }
}

void DqnLearner::resetTargets(const float* parameters) {
  for (int k = 0; k < settings_.averaged_targets; ++k) {
    std::copy_n(parameters, network_.size(), target(k));
  }
}

std::int64_t DqnLearner::collect(const float* parameters, Rng& rng) {
  std::int64_t transitions = 0;
  if (!started_) {
    started_ = true;
    for (std::size_t i = 0; i < envs_.size(); ++i) {
      envs_[i]->reset(rng, next_observation_.data());
      std::copy(next_observation_.begin(), next_observation_.end(),
                &observations_[i * next_observation_.size()]);
    }
    for (int t = 0; t < settings_.warm_up_steps; ++t) transitions += stepAll(parameters, 1, rng);
  }
  for (int t = 0; t < settings_.env_steps_per_update; ++t) {
    transitions += stepAll(parameters, epsilon(), rng);
  }
  return transitions;
}

std::int64_t DqnLearner::stepAll(const float* parameters, double epsilon, Rng& rng) {
  const float* q_values =
      network_.forward(parameters, observations_.data(), envs_.size(), workspace_);
  for (std::size_t i = 0; i < envs_.size(); ++i) {
    const int action = rng.uniform() < epsilon
                           ? static_cast<int>(rng.below(static_cast<std::uint64_t>(num_actions_)))
                           : bestOf(q_values + i * num_actions_, num_actions_);
    const double env_action = action;
    const float stored_action = static_cast<float>(action);
    const Step step = envs_[i]->step(&env_action, rng, next_observation_.data());
    std::copy(next_observation_.begin(), next_observation_.end(), next_observation_float_.begin());

    float* observation = &observations_[i * next_observation_.size()];
    n_step_.add(static_cast<int>(i), observation, &stored_action, step,
                next_observation_float_.data(), replay_);
    if (step.terminated || step.truncated) envs_[i]->reset(rng, next_observation_.data());
    std::copy(next_observation_.begin(), next_observation_.end(), observation);
  }
  return static_cast<std::int64_t>(envs_.size());
}

void DqnLearner::greedyActions(const float* parameters, const float* observations, int batch,
                               MlpWorkspace& workspace, double* actions) const {
  const float* q_values =
      network_.forward(parameters, observations, static_cast<std::size_t>(batch), workspace);
  for (int b = 0; b < batch; ++b) actions[b] = bestOf(q_values + b * num_actions_, num_actions_);
}

double DqnLearner::update(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  replay_.sample(settings_.batch_size, rng, batch_);
  computeTargets(parameters);
  // last of the forward passes: the workspace then holds what the backward pass needs
  const float* q_values =
      network_.forward(parameters, batch_.observations.data(), settings_.batch_size, workspace_);
  const double loss = computeOutputGradient(q_values);
  network_.backward(parameters, batch_.observations.data(), settings_.batch_size,
                    output_gradient_.data(), gradient_.data(), nullptr, workspace_);
  optimizer.apply(0, gradient_.data(), gradient_.size());
  replay_.setPriorities(batch_, td_errors_.data());

  ++updates_;
  if (updates_ % settings_.target_update_interval == 0) {
    newest_target_ = (newest_target_ + 1) % settings_.averaged_targets;
    std::copy_n(parameters, network_.size(), target(newest_target_));
  }
  return loss;
}

void DqnLearner::computeTargets(const float* parameters) {
  const float* next = batch_.next_observations.data();
  std::fill(target_values_.begin(), target_values_.end(), 0.0f);
  const float share = 1.0f / static_cast<float>(settings_.averaged_targets);
  for (int k = 0; k < settings_.averaged_targets; ++k) {
    const float* values = network_.forward(target(k), next, settings_.batch_size, workspace_);
    for (std::size_t j = 0; j < target_values_.size(); ++j) target_values_[j] += share * values[j];
  }

  const float* chooser = target_values_.data();
  if (settings_.double_q) {
    chooser = network_.forward(parameters, next, settings_.batch_size, workspace_);
  }
  for (int b = 0; b < settings_.batch_size; ++b) {
    const int row = b * num_actions_;
    const int action = bestOf(chooser + row, num_actions_);
    td_targets_[b] = batch_.rewards[b] + batch_.discounts[b] * target_values_[row + action];
  }
}

double DqnLearner::computeOutputGradient(const float* q_values) {
  const auto entry = [&](int b) {
    return b * num_actions_ + static_cast<int>(batch_.actions[static_cast<std::size_t>(b)]);
  };
  for (int b = 0; b < settings_.batch_size; ++b) {
    td_errors_[b] = q_values[entry(b)] - td_targets_[b];
  }
  const float* weights = batch_.weights.data();
  const double loss = settings_.huber
                          ? kernels().huberLoss(td_errors_.data(), weights, 1.0f,
                                                sample_gradient_.data(), td_errors_.size())
                          : kernels().squaredLoss(td_errors_.data(), weights,
                                                  sample_gradient_.data(), td_errors_.size());
  std::fill(output_gradient_.begin(), output_gradient_.end(), 0.0f);
  for (int b = 0; b < settings_.batch_size; ++b) output_gradient_[entry(b)] = sample_gradient_[b];
  return loss;
}

void DqnLearner::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.count("updates", updates_);
  writer.count("newest_target", newest_target_);
  writer.array("targets", targets_);
  writer.part("replay", replay_);
  writer.part("n_step", n_step_);
  if (!started_) return;
  writer.array("observations", observations_);
  for (std::size_t i = 0; i < envs_.size(); ++i) writer.part("env_" + std::to_string(i), *envs_[i]);
}

void DqnLearner::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  updates_ = reader.count("updates");
  newest_target_ =
      static_cast<int>(reader.count("newest_target", 0, settings_.averaged_targets - 1));
  reader.array("targets", targets_);
  reader.part("replay", replay_);
  reader.part("n_step", n_step_);
  // actions become indices
  for (std::size_t slot = 0; slot < replay_.size(); ++slot) {
    if (!isAction(*replay_.buffer()[slot].action)) reader.refuse("replay", "holds no action");
  }
  for (const NStepAccumulator::Queue& queue : n_step_.queues()) {
    for (const float action : queue.actions) {
      if (!isAction(action)) reader.refuse("n_step", "holds no action");
    }
  }
  if (!started_) return;
  if (replay_.size() == 0) reader.refuse("replay", "is empty after the warm-up");
  reader.array("observations", observations_);
  for (std::size_t i = 0; i < envs_.size(); ++i) reader.part("env_" + std::to_string(i), *envs_[i]);
}

bool DqnLearner::isAction(float action) const {
  return action >= 0 && action < static_cast<float>(num_actions_) && action == std::floor(action);
}

}  // namespace pmeta
