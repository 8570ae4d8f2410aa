#include "pmeta_core/learn/sac_update.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/gradient_surgery.h"
#include "pmeta_core/learn/sac_losses.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

std::size_t countContexts(const SacSettings& settings) {
  if (settings.task_encoding != "inference") return 0;
  if (settings.context.per_update > settings.batch_size) {
    throw Error("soft actor-critic cannot share a batch of " + std::to_string(settings.batch_size) +
                " transitions among " + std::to_string(settings.context.per_update) +
                " contexts: contexts_per_update is at most batch_size.");
  }
  return static_cast<std::size_t>(settings.context.per_update);
}

}  // namespace

SacUpdate::SacUpdate(const SacNetworks& networks, const SacSettings& settings,
                     std::vector<float> task_input)
    : networks_(networks),
      reward_scale_(settings.reward_scale),
      tau_(settings.tau),
      kl_weight_(settings.context.kl_weight),
      head_penalty_(settings.head_penalty),
      batch_(static_cast<std::size_t>(settings.batch_size)),
      observation_size_(networks.observationSize()),
      action_size_(networks.actionSize()),
      task_input_(std::move(task_input)),
      temperature_(settings.temperature, static_cast<int>(action_size_)),
      targets_(networks_.hasValue() ? networks_.value().size()
                                    : networks_.critic(0).size() + networks_.critic(1).size()),
      policy_rows_(networks_.hasValue() ? batch_ : 2 * batch_),
      actor_workspace_(networks_.actor(), policy_rows_),
      policy_(action_size_, policy_rows_, networks_.minLogStd()),
      actor_input_(2 * batch_ * networks_.actor().inputs()),
      critic_input_(batch_ * networks_.critic(0).inputs()),
      next_critic_input_(critic_input_),
      rewards_(batch_),
      discounts_(batch_),
      soft_values_(batch_),
      y_(batch_),
      errors_(batch_),
      d_q_(batch_),
      d_action_rows_(batch_ * action_size_),
      d_action_(batch_ * action_size_),
      d_heads_(2 * batch_ * action_size_),
      gradient_(std::max(networks_.actor().size(), networks_.critic(0).size())) {
  if (settings.surgery_tasks > 0) {
    surgery_.emplace().gradients.resize(static_cast<std::size_t>(settings.surgery_tasks));
    for (const Mlp* network : {&networks_.actor(), &networks_.critic(0), &networks_.critic(1)}) {
      surgery_->workspaces.emplace(network, MlpWorkspace(*network, batch_));
    }
  }
  if (settings.task_encoding == "given") {
    d_task_input_.resize(batch_ * networks_.taskInputSize());
    d_latent_rows_.resize(d_task_input_.size());
  }
  const std::size_t contexts = countContexts(settings);
  for (int k = 0; k < 2; ++k) {
    critic_workspaces_.emplace_back(networks_.critic(k), batch_);
    minimum_rows_[k].reserve(batch_);
  }
  if (networks_.hasValue()) {
    value_workspace_.emplace(networks_.value(), batch_);
    gradient_.resize(std::max(gradient_.size(), networks_.value().size()));
  }
  if (contexts == 0) return;
  const ContextEncoder& encoder = networks_.encoder();
  for (std::size_t k = 0; k < contexts; ++k) tasks_.emplace_back(encoder, settings.context);
  d_latent_rows_.resize(batch_ * encoder.latentSize());
  encoder_gradient_.resize(encoder.network().size());
  gradient_.resize(std::max(gradient_.size(), encoder.network().size()));
}

void SacUpdate::resetTargets(const float* parameters) {
  if (networks_.hasValue()) {
    std::copy_n(parameters + networks_.valueOffset(), targets_.size(), targets_.begin());
    return;
  }
  for (int k = 0; k < 2; ++k) {
    std::copy_n(parameters + networks_.criticOffset(k), networks_.critic(k).size(), target(k));
  }
}

void SacUpdate::put(std::size_t row, const Transition& t) {
  const std::vector<float>& x = tasks_.empty() ? task_input_ : taskOf(row).z;
  put(row, t, x.data(), x.data());
}

// into the inputs of all networks; the next actions are not known yet
void SacUpdate::put(std::size_t row, const Transition& t, const float* x, const float* next_x) {
  const std::size_t actor_row = networks_.actor().inputs();
  const auto write = [&](const float* observation, const float* input, float* actor,
                         float* critic) {
    std::copy_n(observation, observation_size_, actor);
    std::copy_n(input, networks_.taskInputSize(), actor + observation_size_);
    return std::copy_n(actor, actor_row, critic);
  };
  const std::size_t critic_row = row * networks_.critic(0).inputs();
  float* action =
      write(t.observation, x, &actor_input_[row * actor_row], &critic_input_[critic_row]);
  std::copy_n(t.action, action_size_, action);
  write(t.next_observation, next_x, &actor_input_[(batch_ + row) * actor_row],
        &next_critic_input_[critic_row]);
  rewards_[row] = t.reward;
  discounts_[row] = t.discount;
}

SacLosses SacUpdate::apply(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  for (InferredTask& task : tasks_) std::fill(task.d_z.begin(), task.d_z.end(), 0.0f);
  std::fill(d_task_input_.begin(), d_task_input_.end(), 0.0f);
  // one pass for the actions in s' and in s: the actor does not move before its own step
  const float* heads =
      networks_.actor().forward(parameters, actor_input_.data(), policy_rows_, actor_workspace_);
  policy_.sample(heads, policy_rows_, rng);
  computeTargets();

  SacLosses losses;
  for (int k = 0; k < 2; ++k) losses.critic += 0.5 * updateCritic(k, parameters, optimizer, rng);
  if (networks_.hasEncoder()) losses.kl = updateEncoder(parameters, optimizer);
  judgeActions(parameters);
  if (networks_.hasValue()) losses.value = updateValue(parameters, optimizer);
  losses.actor = updateActor(parameters, optimizer, rng);

  double mean_log_prob = 0;
  for (std::size_t b = 0; b < batch_; ++b) mean_log_prob += policy_.logProbs()[b];
  mean_log_prob /= static_cast<double>(batch_);
  temperature_.update(mean_log_prob);
  losses.entropy = -mean_log_prob;
  losses.temperature = temperature_.value();
  ++updates_;
  return losses;
}

void SacUpdate::computeTargets() {
  const float* next_values = soft_values_.data();
  if (networks_.hasValue()) {
    next_values = networks_.value().forward(targets_.data(),
                                            &actor_input_[batch_ * networks_.actor().inputs()],
                                            batch_, *value_workspace_);
  } else {
    putActions(policy_.actions() + batch_ * action_size_, next_critic_input_);
    const float* q[2];
    for (int k = 0; k < 2; ++k) {
      q[k] = networks_.critic(k).forward(target(k), next_critic_input_.data(), batch_,
                                         critic_workspaces_[static_cast<std::size_t>(k)]);
    }
    softValues(q[0], q[1], policy_.logProbs() + batch_, static_cast<float>(temperature_.value()),
               batch_, soft_values_.data());
  }
  criticTargets(rewards_.data(), discounts_.data(), next_values, static_cast<float>(reward_scale_),
                batch_, y_.data());
}

// as the last inputs of each row
void SacUpdate::putActions(const float* actions, AlignedFloats& critic_input) const {
  const std::size_t row = networks_.critic(0).inputs();
  for (std::size_t b = 0; b < batch_; ++b) {
    std::copy_n(actions + b * action_size_, action_size_,
                &critic_input[(b + 1) * row - action_size_]);
  }
}

// The gradient of a network whose rows are of several tasks, with surgery between them, into
// gradient_. Costs a forward pass more.
void SacUpdate::operateOn(const Mlp& network, const float* parameters, const float* input,
                          const float* d_output, Rng& rng) {
  const std::size_t tasks = surgery_->gradients.size();
  MlpWorkspace& workspace = surgery_->workspaces.at(&network);
  const auto first = [&](std::size_t task) { return (task * batch_ + tasks - 1) / tasks; };
  for (std::size_t task = 0; task < tasks; ++task) {
    const std::size_t begin = first(task);
    const std::size_t rows = first(task + 1) - begin;
    AlignedFloats& gradient = surgery_->gradients[task];
    gradient.resize(network.size());
    const float* of_task = input + begin * network.inputs();
    network.forward(parameters, of_task, rows, workspace);
    network.backward(parameters, of_task, rows, d_output + begin * network.outputs(),
                     gradient.data(), nullptr, workspace);
  }
  surgery_->scratch.resize(network.size());
  operate(surgery_->gradients, rng, surgery_->scratch, gradient_.data());
}

double SacUpdate::updateCritic(int k, const float* parameters, Optimizer<float>& optimizer,
                               Rng& rng) {
  const Mlp& critic = networks_.critic(k);
  const float* theta = parameters + networks_.criticOffset(k);
  MlpWorkspace& workspace = critic_workspaces_[static_cast<std::size_t>(k)];
  const float* q = critic.forward(theta, critic_input_.data(), batch_, workspace);
  for (std::size_t b = 0; b < batch_; ++b) errors_[b] = q[b] - y_[b];
  const double loss = kernels().squaredLoss(errors_.data(), nullptr, d_q_.data(), batch_);
  const std::size_t latent = d_latent_rows_.size() / batch_;  // 0 where nobody wants it
  if (!surgery_ || latent > 0) {
    critic.backward(theta, critic_input_.data(), batch_, d_q_.data(), gradient_.data(),
                    observation_size_, latent, latent == 0 ? nullptr : d_latent_rows_.data(),
                    workspace);
  }
  if (surgery_) operateOn(critic, theta, critic_input_.data(), d_q_.data(), rng);
  for (std::size_t i = 0; i < d_task_input_.size(); ++i) d_task_input_[i] += d_latent_rows_[i];
  for (std::size_t b = 0; b < batch_ && !tasks_.empty(); ++b) {
    float* d_z = taskOf(b).d_z.data();
    for (std::size_t j = 0; j < latent; ++j) d_z[j] += d_latent_rows_[b * latent + j];
  }
  optimizer.apply(networks_.criticOffset(k), gradient_.data(), critic.size(),
                  networks_.hasValue() ? nullptr : target(k), tau_);
  return loss;
}

double SacUpdate::updateEncoder(const float* parameters, Optimizer<float>& optimizer) {
  const ContextEncoder& encoder = networks_.encoder();
  const std::size_t size = encoder.network().size();
  const auto n = static_cast<double>(tasks_.size());
  double kl = 0;
  std::fill_n(gradient_.begin(), size, 0.0f);
  for (InferredTask& task : tasks_) {
    kl += klToPrior(task.posterior) / n;
    encoder.backward(parameters + networks_.encoderOffset(), task.rows.data(),
                     task.rows.size() / encoder.rowSize(), task.posterior, task.noise.data(),
                     task.d_z.data(), kl_weight_ / n, task.workspace, encoder_gradient_.data());
    for (std::size_t k = 0; k < size; ++k) gradient_[k] += encoder_gradient_[k];
  }
  optimizer.apply(networks_.encoderOffset(), gradient_.data(), size);
  return kl;
}

// by the critics that have moved
void SacUpdate::judgeActions(const float* parameters) {
  putActions(policy_.actions(), critic_input_);
  for (int k = 0; k < 2; ++k) {
    q_[k] =
        networks_.critic(k).forward(parameters + networks_.criticOffset(k), critic_input_.data(),
                                    batch_, critic_workspaces_[static_cast<std::size_t>(k)]);
    minimum_rows_[k].clear();
  }
  for (std::size_t b = 0; b < batch_; ++b) minimum_rows_[q_[0][b] <= q_[1][b] ? 0 : 1].push_back(b);
}

double SacUpdate::updateValue(const float* parameters, Optimizer<float>& optimizer) {
  const Mlp& value = networks_.value();
  const float* theta = parameters + networks_.valueOffset();
  softValues(q_[0], q_[1], policy_.logProbs(), static_cast<float>(temperature_.value()), batch_,
             soft_values_.data());
  const float* v = value.forward(theta, actor_input_.data(), batch_, *value_workspace_);
  for (std::size_t b = 0; b < batch_; ++b) errors_[b] = v[b] - soft_values_[b];
  const double loss = kernels().squaredLoss(errors_.data(), nullptr, d_q_.data(), batch_);
  value.backward(theta, actor_input_.data(), batch_, d_q_.data(), gradient_.data(), nullptr,
                 *value_workspace_);
  optimizer.apply(networks_.valueOffset(), gradient_.data(), value.size(), targets_.data(), tau_);
  return loss;
}

double SacUpdate::updateActor(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  const double alpha = temperature_.value();
  double loss = actorLoss(q_[0], q_[1], policy_.logProbs(), alpha, batch_);
  const auto n = static_cast<float>(batch_);
  std::fill(d_q_.begin(), d_q_.end(), -1 / n);
  for (int k = 0; k < 2; ++k) actionGradient(k, parameters);

  policy_.backward(batch_, d_action_.data(), static_cast<float>(alpha) / n, d_heads_.data());
  if (head_penalty_ > 0) loss += policy_.addPenalty(batch_, head_penalty_, d_heads_.data());
  if (surgery_) {
    operateOn(networks_.actor(), parameters, actor_input_.data(), d_heads_.data(), rng);
  } else {
    networks_.actor().backward(parameters, actor_input_.data(), batch_, d_heads_.data(),
                               gradient_.data(), nullptr, actor_workspace_);
  }
  optimizer.apply(0, gradient_.data(), networks_.actor().size());
  return loss;
}

// gradient by the actions of those samples whose smaller critic is k
void SacUpdate::actionGradient(int k, const float* parameters) {
  const std::vector<std::size_t>& rows = minimum_rows_[k];
  if (rows.empty()) return;
  networks_.critic(k).backwardInput(parameters + networks_.criticOffset(k), rows.size(),
                                    d_q_.data(), networks_.actor().inputs(), action_size_,
                                    d_action_rows_.data(),
                                    critic_workspaces_[static_cast<std::size_t>(k)], rows.data());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(&d_action_rows_[i * action_size_], action_size_,
                &d_action_[rows[i] * action_size_]);
  }
}

void SacUpdate::saveState(StateWriter& writer) const {
  writer.count("updates", updates_);
  writer.array("targets", targets_);
  writer.part("temperature", temperature_);
}

void SacUpdate::loadState(StateReader& reader) {
  updates_ = reader.count("updates");
  reader.array("targets", targets_);
  reader.part("temperature", temperature_);
}

}  // namespace pmeta
