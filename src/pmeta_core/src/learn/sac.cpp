#include "pmeta_core/learn/sac.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

std::vector<float> requireTaskInput(std::vector<float> task_input, const SacSettings& settings) {
  if ((settings.task_encoding == "one_hot") == task_input.empty()) {
    throw Error("soft actor-critic takes a task input of " + std::to_string(task_input.size()) +
                " numbers with task_encoding '" + settings.task_encoding +
                "': give the one-hot vector with one_hot, and nothing otherwise.");
  }
  return task_input;
}

std::size_t contextCapacity(const SacSettings& settings) {
  const bool used = settings.task_encoding == "inference";
  return used ? static_cast<std::size_t>(settings.context.buffer_size) : 1;
}

std::size_t requireContexts(const SacSettings& settings) {
  if (settings.task_encoding != "inference") return 1;
  if (settings.context.per_update > settings.batch_size) {
    throw Error("soft actor-critic cannot share a batch of " + std::to_string(settings.batch_size) +
                " transitions among " + std::to_string(settings.context.per_update) +
                " contexts: contexts_per_update is at most batch_size.");
  }
  return static_cast<std::size_t>(settings.context.per_update);
}

}  // namespace

SacLearner::SacLearner(std::unique_ptr<Env> env, const SacSettings& settings,
                       std::vector<float> task_input)
    : env_(std::move(env)),
      settings_(settings),
      networks_(env_->spec(), settings, static_cast<int>(task_input.size())),
      batch_(static_cast<std::size_t>(settings.batch_size)),
      observation_size_(networks_.observationSize()),
      action_size_(networks_.actionSize()),
      task_input_(requireTaskInput(std::move(task_input), settings)),
      temperature_(settings.temperature, env_->spec().action_size),
      replay_(static_cast<std::size_t>(settings.buffer_size), env_->spec().observation_size,
              env_->spec().action_size),
      context_(contextCapacity(settings), env_->spec().observation_size, env_->spec().action_size),
      targets_(networks_.critic(0).size() + networks_.critic(1).size()),
      observation_(observation_size_),
      next_observation_float_(observation_size_),
      action_float_(action_size_),
      next_observation_(observation_size_),
      action_(action_size_),
      acting_(networks_, 1),
      acting_policy_(action_size_, 1),
      actor_workspace_(networks_.actor(), 2 * batch_),
      policy_(action_size_, 2 * batch_),
      actor_input_(2 * batch_ * networks_.actor().inputs()),
      critic_input_(batch_ * networks_.critic(0).inputs()),
      next_critic_input_(critic_input_),
      rewards_(batch_),
      discounts_(batch_),
      y_(batch_),
      errors_(batch_),
      d_q_(batch_),
      d_action_rows_(batch_ * action_size_),
      d_action_(batch_ * action_size_),
      d_heads_(2 * batch_ * action_size_),
      gradient_(std::max(networks_.actor().size(), networks_.critic(0).size())) {
  const std::size_t contexts = requireContexts(settings);
  for (int k = 0; k < 2; ++k) {
    critic_workspaces_.emplace_back(networks_.critic(k), batch_);
    minimum_rows_[k].reserve(batch_);
  }
  if (networks_.hasEncoder()) {
    const ContextEncoder& encoder = networks_.encoder();
    const auto rows = static_cast<std::size_t>(settings.context.batch_size);
    const std::size_t latent = encoder.latentSize();
    const std::vector<double> zeros(latent);
    for (std::size_t k = 0; k < contexts; ++k) {
      drawn_.push_back({AlignedFloats(rows * encoder.rowSize()),
                        ContextEncoder::Workspace(encoder, rows),
                        {zeros, zeros},
                        zeros,
                        std::vector<float>(latent)});
    }
    d_latent_rows_.resize(batch_ * latent);
    encoder_gradient_.resize(encoder.network().size());
    task_input_.resize(latent);
    gradient_.resize(std::max(gradient_.size(), encoder.network().size()));
  }
  update_inputs_.assign(contexts, task_input_);
}

void SacLearner::resetTargets(const float* parameters) {
  for (int k = 0; k < 2; ++k) {
    std::copy_n(parameters + networks_.criticOffset(k), networks_.critic(k).size(), target(k));
  }
}

std::int64_t SacLearner::collect(const float* parameters, Rng& rng, const float* explorer) {
  std::int64_t transitions = 0;
  if (!started_) {
    started_ = true;
    beginEpisode(parameters, true, rng);
    for (int t = 0; t < settings_.warm_up_steps; ++t) {
      transitions += step(parameters, explorer, true, rng);
    }
  }
  for (int t = 0; t < settings_.env_steps_per_update; ++t) {
    transitions += step(parameters, explorer, false, rng);
  }
  // an update needs one, and each step so far may have broken its episode
  while (replay_.size() == 0) transitions += step(parameters, explorer, true, rng);
  return transitions;
}

void SacLearner::beginEpisode(const float* parameters, bool warm_up, Rng& rng) {
  for (bool started = false; !started;) {
    try {
      env_->reset(rng, next_observation_.data());
      started = true;
    } catch (const BrokenEpisode& episode) {
      broken_.broke(episode);
    }
  }
  std::copy(next_observation_.begin(), next_observation_.end(), observation_.begin());
  // while no step has become context there is nothing else to draw from
  prior_episode_ =
      warm_up || context_.size() == 0 || episodes_ % settings_.context.prior_interval == 0;
  episodes_ += warm_up ? 0 : 1;
  if (!networks_.hasEncoder()) return;
  if (prior_episode_) {
    for (float& z : task_input_) z = static_cast<float>(rng.normal());
    return;
  }
  drawTask(0, parameters, rng);
  task_input_ = update_inputs_[0];
}

// the transitions made: 1, or 0 where the episode broke down
std::int64_t SacLearner::step(const float* parameters, const float* explorer, bool warm_up,
                              Rng& rng) {
  if (warm_up) {
    for (float& a : action_float_) a = static_cast<float>(2 * rng.uniform() - 1);
  } else {
    const float* actor = prior_episode_ && explorer != nullptr ? explorer : parameters;
    acting_policy_.sample(
        networks_.heads(actor, observation_.data(), 1, task_input_.data(), acting_), 1, rng);
    std::copy_n(acting_policy_.actions(), action_size_, action_float_.begin());
  }
  std::copy(action_float_.begin(), action_float_.end(), action_.begin());
  Step step;
  try {
    step = env_->step(action_.data(), rng, next_observation_.data());
  } catch (const BrokenEpisode& episode) {
    broken_.broke(episode);
    beginEpisode(parameters, warm_up, rng);
    return 0;
  }
  std::copy(next_observation_.begin(), next_observation_.end(), next_observation_float_.begin());

  Transition transition{observation_.data(), action_float_.data(), static_cast<float>(step.reward),
                        step.terminated ? 0.0f : static_cast<float>(settings_.gamma),
                        next_observation_float_.data()};
  replay_.add(transition);
  if (networks_.hasEncoder() && (prior_episode_ || settings_.context.posterior_episodes)) {
    transition.reward = static_cast<float>(step.evaluatedReward());
    context_.add(transition);
  }
  std::swap(observation_, next_observation_float_);
  if (step.terminated || step.truncated) {
    broken_.ended();
    beginEpisode(parameters, warm_up, rng);
  }
  return 1;
}

void SacLearner::sampleContext(float* rows, Rng& rng) {
  const std::size_t kept = context_.size();
  std::size_t window = kept, first = 0;
  if (settings_.context.window > 0 && static_cast<std::size_t>(settings_.context.window) < kept) {
    window = static_cast<std::size_t>(settings_.context.window);
    const std::size_t oldest = kept < context_.capacity() ? 0 : context_.next();
    first = oldest + rng.below(kept - window + 1);
  }
  for (int i = 0; i < settings_.context.batch_size; ++i, rows += networks_.encoder().rowSize()) {
    networks_.encoder().writeRow(context_[(first + rng.below(window)) % kept], rows);
  }
}

void SacLearner::drawTask(std::size_t context, const float* parameters, Rng& rng) {
  const ContextEncoder& encoder = networks_.encoder();
  DrawnTask& drawn = drawn_[context];
  sampleContext(drawn.rows.data(), rng);
  encoder.infer(parameters + networks_.encoderOffset(), drawn.rows.data(),
                drawn.rows.size() / encoder.rowSize(), drawn.workspace, drawn.posterior);
  for (std::size_t j = 0; j < drawn.noise.size(); ++j) {
    drawn.noise[j] = rng.normal();
    update_inputs_[context][j] = static_cast<float>(
        drawn.posterior.mean[j] + std::sqrt(drawn.posterior.variance[j]) * drawn.noise[j]);
  }
}

// inputs of all networks; the next actions are not known yet
void SacLearner::sampleBatch(Rng& rng) {
  const std::size_t actor_row = networks_.actor().inputs();
  for (std::size_t b = 0; b < batch_; ++b) {
    const std::vector<float>& x = update_inputs_[contextOf(b)];
    const auto write = [&](const float* observation, float* actor, float* critic) {
      std::copy_n(observation, observation_size_, actor);
      std::copy(x.begin(), x.end(), actor + observation_size_);
      return std::copy_n(actor, actor_row, critic);
    };
    const Transition t = replay_[rng.below(replay_.size())];
    const std::size_t critic_row = b * networks_.critic(0).inputs();
    float* action = write(t.observation, &actor_input_[b * actor_row], &critic_input_[critic_row]);
    std::copy_n(t.action, action_size_, action);
    write(t.next_observation, &actor_input_[(batch_ + b) * actor_row],
          &next_critic_input_[critic_row]);
    rewards_[b] = t.reward;
    discounts_[b] = t.discount;
  }
}

SacLosses SacLearner::update(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  if (replay_.size() == 0) throw Error("call collect() before soft actor-critic's update().");
  for (std::size_t k = 0; k < drawn_.size(); ++k) {
    drawTask(k, parameters, rng);
    std::fill(drawn_[k].d_latent.begin(), drawn_[k].d_latent.end(), 0.0f);
  }
  sampleBatch(rng);
  // one pass for the actions in s' and in s: the actor does not move before its own step
  const float* heads =
      networks_.actor().forward(parameters, actor_input_.data(), 2 * batch_, actor_workspace_);
  policy_.sample(heads, 2 * batch_, rng);
  computeTargets();

  SacLosses losses;
  for (int k = 0; k < 2; ++k) losses.critic += 0.5 * updateCritic(k, parameters, optimizer);
  if (networks_.hasEncoder()) losses.kl = updateEncoder(parameters, optimizer);
  losses.actor = updateActor(parameters, optimizer);

  double mean_log_prob = 0;
  for (std::size_t b = 0; b < batch_; ++b) mean_log_prob += policy_.logProbs()[b];
  mean_log_prob /= static_cast<double>(batch_);
  temperature_.update(mean_log_prob);
  losses.entropy = -mean_log_prob;
  losses.temperature = temperature_.value();
  ++updates_;
  return losses;
}

void SacLearner::computeTargets() {
  const std::size_t row = networks_.critic(0).inputs();
  const float* next_actions = policy_.actions() + batch_ * action_size_;
  for (std::size_t b = 0; b < batch_; ++b) {
    std::copy_n(next_actions + b * action_size_, action_size_,
                &next_critic_input_[(b + 1) * row - action_size_]);
  }
  const float* q[2];
  for (int k = 0; k < 2; ++k) {
    q[k] = networks_.critic(k).forward(target(k), next_critic_input_.data(), batch_,
                                       critic_workspaces_[static_cast<std::size_t>(k)]);
  }
  const float* log_prob = policy_.logProbs() + batch_;
  const auto alpha = static_cast<float>(temperature_.value());
  const auto scale = static_cast<float>(settings_.reward_scale);
  for (std::size_t b = 0; b < batch_; ++b) {
    const float smaller = q[0][b] <= q[1][b] ? q[0][b] : q[1][b];
    y_[b] = scale * rewards_[b] + discounts_[b] * (smaller - alpha * log_prob[b]);
  }
}

double SacLearner::updateCritic(int k, const float* parameters, Optimizer<float>& optimizer) {
  const Mlp& critic = networks_.critic(k);
  const float* theta = parameters + networks_.criticOffset(k);
  MlpWorkspace& workspace = critic_workspaces_[static_cast<std::size_t>(k)];
  const float* q = critic.forward(theta, critic_input_.data(), batch_, workspace);
  for (std::size_t b = 0; b < batch_; ++b) errors_[b] = q[b] - y_[b];
  const double loss = kernels().squaredLoss(errors_.data(), nullptr, d_q_.data(), batch_);
  const std::size_t latent = d_latent_rows_.size() / batch_;  // 0 without an encoder
  critic.backward(theta, critic_input_.data(), batch_, d_q_.data(), gradient_.data(),
                  observation_size_, latent, latent == 0 ? nullptr : d_latent_rows_.data(),
                  workspace);
  for (std::size_t b = 0; b < batch_ && latent > 0; ++b) {
    float* d_latent = drawn_[contextOf(b)].d_latent.data();
    for (std::size_t j = 0; j < latent; ++j) d_latent[j] += d_latent_rows_[b * latent + j];
  }
  optimizer.apply(networks_.criticOffset(k), gradient_.data(), critic.size(), target(k),
                  settings_.tau);
  return loss;
}

double SacLearner::updateEncoder(const float* parameters, Optimizer<float>& optimizer) {
  const ContextEncoder& encoder = networks_.encoder();
  const std::size_t size = encoder.network().size();
  const auto n = static_cast<double>(drawn_.size());
  double kl = 0;
  std::fill_n(gradient_.begin(), size, 0.0f);
  for (DrawnTask& drawn : drawn_) {
    kl += klToPrior(drawn.posterior) / n;
    encoder.backward(parameters + networks_.encoderOffset(), drawn.rows.data(),
                     drawn.rows.size() / encoder.rowSize(), drawn.posterior, drawn.noise.data(),
                     drawn.d_latent.data(), settings_.context.kl_weight / n, drawn.workspace,
                     encoder_gradient_.data());
    for (std::size_t k = 0; k < size; ++k) gradient_[k] += encoder_gradient_[k];
  }
  optimizer.apply(networks_.encoderOffset(), gradient_.data(), size);
  return kl;
}

double SacLearner::updateActor(const float* parameters, Optimizer<float>& optimizer) {
  const std::size_t row = networks_.critic(0).inputs();
  for (std::size_t b = 0; b < batch_; ++b) {
    std::copy_n(policy_.actions() + b * action_size_, action_size_,
                &critic_input_[(b + 1) * row - action_size_]);
  }
  const float* q[2];
  for (int k = 0; k < 2; ++k) {
    q[k] = networks_.critic(k).forward(parameters + networks_.criticOffset(k), critic_input_.data(),
                                       batch_, critic_workspaces_[static_cast<std::size_t>(k)]);
    minimum_rows_[k].clear();
  }
  const double alpha = temperature_.value();
  double loss = 0;
  for (std::size_t b = 0; b < batch_; ++b) {
    const int k = q[0][b] <= q[1][b] ? 0 : 1;
    minimum_rows_[k].push_back(b);
    loss += alpha * policy_.logProbs()[b] - q[k][b];
  }
  const auto n = static_cast<float>(batch_);
  std::fill(d_q_.begin(), d_q_.end(), -1 / n);
  for (int k = 0; k < 2; ++k) actionGradient(k, parameters);

  policy_.backward(batch_, d_action_.data(), static_cast<float>(alpha) / n, d_heads_.data());
  networks_.actor().backward(parameters, actor_input_.data(), batch_, d_heads_.data(),
                             gradient_.data(), nullptr, actor_workspace_);
  optimizer.apply(0, gradient_.data(), networks_.actor().size());
  return loss / static_cast<double>(batch_);
}

// gradient by the actions of those samples whose smaller critic is k
void SacLearner::actionGradient(int k, const float* parameters) {
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

LatentPosterior SacLearner::contextPosterior(const float* parameters) const {
  if (!networks_.hasEncoder()) throw Error("there is no context encoder to ask for z.");
  const ContextEncoder& encoder = networks_.encoder();
  std::vector<float> rows(context_.size() * encoder.rowSize());
  for (std::size_t i = 0; i < context_.size(); ++i) {
    encoder.writeRow(context_[i], &rows[i * encoder.rowSize()]);
  }
  ContextEncoder::Workspace workspace(encoder, std::max<std::size_t>(1, context_.size()));
  LatentPosterior posterior;
  encoder.infer(parameters + networks_.encoderOffset(), rows.data(), context_.size(), workspace,
                posterior);
  return posterior;
}

void SacLearner::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.count("updates", updates_);
  writer.count("episodes", episodes_);
  writer.part("broken", broken_);
  writer.flag("prior_episode", prior_episode_);
  writer.array("targets", targets_);
  writer.part("temperature", temperature_);
  writer.part("replay", replay_);
  writer.part("context", context_);
  if (!started_) return;
  writer.array("observation", observation_);
  writer.array("task_input", task_input_);
  writer.part("env", *env_);
}

void SacLearner::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  updates_ = reader.count("updates");
  episodes_ = reader.count("episodes");
  reader.part("broken", broken_);
  prior_episode_ = reader.flag("prior_episode");
  reader.array("targets", targets_);
  reader.part("temperature", temperature_);
  reader.part("replay", replay_);
  reader.part("context", context_);
  if (!started_) return;
  if (replay_.size() == 0) reader.refuse("replay", "is empty after the start");
  if (networks_.hasEncoder() && context_.size() == 0) {
    reader.refuse("context", "is empty after the start");
  }
  reader.array("observation", observation_);
  std::vector<float> task_input(task_input_.size());
  reader.array("task_input", task_input);
  if (!networks_.hasEncoder() && task_input != task_input_) {
    reader.refuse("task_input", "is that of another task");
  }
  task_input_ = std::move(task_input);
  reader.part("env", *env_);
}

}  // namespace pmeta
