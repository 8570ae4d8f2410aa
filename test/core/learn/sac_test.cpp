#include "pmeta_core/learn/sac.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <vector>

#include "../allocations.h"
#include "../memory_state.h"
#include "../support.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {
namespace {

// a point on a line, pushed by the first action in its task's direction; obs = (x, x^2, time)
class PushedPoint : public Env {
 public:
  explicit PushedPoint(double direction = 1) : direction_(direction) {
    spec_.name = "pushed_point";
    spec_.observation_size = 3;
    spec_.action_size = 2;
    spec_.horizon = 12;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    x_ = rng.normal();
    t_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    EXPECT_LE(std::abs(action[0]), 1);
    EXPECT_LE(std::abs(action[1]), 1);
    x_ += 0.5 * direction_ * action[0] + 0.3 * rng.normal();
    ++t_;
    observe(observation);
    Step step{-x_ * x_ - 0.1 * action[1] * action[1], std::abs(x_) > 2.5, t_ == spec_.horizon};
    step.sparse_reward = direction_ * action[0];
    return step;
  }
  std::vector<double> state() const override { return {x_, static_cast<double>(t_)}; }
  void setState(const std::vector<double>& state) override {
    x_ = state[0];
    t_ = static_cast<int>(state[1]);
  }

 private:
  void observe(double* observation) const {
    observation[0] = x_;
    observation[1] = x_ * x_;
    observation[2] = 0.1 * t_;
  }
  EnvSpec spec_;
  double direction_;
  double x_ = 0;
  int t_ = 0;
};

SacSettings smallSettings(const std::string& task_encoding = "none") {
  SacSettings settings;
  settings.hidden = {8, 6};
  settings.batch_size = 16;
  settings.buffer_size = 1000;
  settings.warm_up_steps = 40;
  settings.gamma = 0.9;
  settings.tau = 0.05;
  settings.reward_scale = 1.5;
  settings.task_encoding = task_encoding;
  settings.context.hidden = {7, 5};
  settings.context.latent_size = 3;
  settings.context.batch_size = 10;
  settings.context.buffer_size = 60;
  return settings;
}

// plain descent that keeps the last gradient and what was asked of it
class Descent : public Optimizer<float> {
 public:
  Descent(AlignedFloats& parameters, float rate) : parameters_(parameters), rate_(rate) {
    gradient.resize(parameters.size());
  }
  std::vector<float> gradient;
  std::vector<std::size_t> offsets;

 private:
  void move(std::size_t offset, const float* g, std::size_t n, float* target, double tau) override {
    offsets.push_back(offset);
    for (std::size_t k = 0; k < n; ++k) {
      gradient[offset + k] = g[k];
      parameters_[offset + k] -= rate_ * g[k];
      if (target != nullptr) {
        target[k] += static_cast<float>(tau) * (parameters_[offset + k] - target[k]);
      }
    }
  }
  AlignedFloats& parameters_;
  float rate_;
};

std::vector<float> taskInput(const SacSettings& settings) {
  return settings.task_encoding == "one_hot" ? oneHot(1, 3) : std::vector<float>();
}

struct Trainer {
  explicit Trainer(const SacSettings& settings, std::uint64_t seed = 0, float rate = 0.02f)
      : learner(std::make_unique<PushedPoint>(), settings, taskInput(settings)),
        parameters(learner.networks().size()),
        optimizer(parameters, rate),
        rng(seed, 0, Stream::kSample) {
    Rng initial(seed, 0, Stream::kInitialise);
    learner.networks().initialise(parameters.data(), initial);
    learner.resetTargets(parameters.data());
  }
  SacLosses update() {
    learner.collect(parameters.data(), rng);
    return learner.update(parameters.data(), optimizer, rng);
  }
  SacLearner learner;
  AlignedFloats parameters;
  Descent optimizer;
  Rng rng;
};

using Vector = std::vector<double>;

Vector concatenated(std::initializer_list<Vector> parts) {
  Vector all;
  for (const Vector& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// outputs of a network in double, its parameters at `p`
template <class Scalar>
Vector outputs(const Mlp& mlp, const Scalar* p, Vector x) {
  const std::vector<Block>& blocks = mlp.blocks();
  for (std::size_t l = 0; l < blocks.size(); l += 2) {
    const std::size_t out = blocks[l].shape[0], in = blocks[l].shape[1];
    Vector y(out);
    for (std::size_t j = 0; j < out; ++j) {
      y[j] = p[out * in + j];
      for (std::size_t i = 0; i < in; ++i) y[j] += p[j * in + i] * x[i];
      if (l + 2 < blocks.size()) y[j] = std::max(y[j], 0.0);
    }
    p += out * (in + 1);
    x = y;
  }
  return x;
}

// one update's draws, repeated from the generator as it was before, and its losses by the equations
class Reference {
 public:
  Reference(const SacLearner& learner, Rng rng)
      : learner_(learner),
        networks_(learner.networks()),
        settings_(learner.settings()),
        alpha_(learner.temperature().value()),
        targets_(learner.targets().begin(), learner.targets().end()) {
    for (int k = 0; networks_.hasEncoder() && k < settings_.context.per_update; ++k) {
      rows_.push_back(context(rng));
      latent_noise_.emplace_back();
      for (std::size_t j = 0; j < 3; ++j) latent_noise_.back().push_back(rng.normal());
    }
    for (int b = 0; b < settings_.batch_size; ++b) {
      const Transition t = learner.replay()[rng.below(learner.replay().size())];
      s_.emplace_back(t.observation, t.observation + 3);
      a_.emplace_back(t.action, t.action + 2);
      next_.emplace_back(t.next_observation, t.next_observation + 3);
      rewards_.push_back(t.reward);
    }
    // for the actions in s, then for those in s'
    for (int b = 0; b < 2 * settings_.batch_size; ++b) {
      const double first = rng.normal();
      noise_.push_back({first, rng.normal()});
    }
  }

  // x of every sample by the parameters p: fixed, or by its encoder the z of the sample's context
  std::vector<Vector> inputs(const Vector& p) const {
    const Vector fixed(learner_.taskInput().begin(), learner_.taskInput().end());
    std::vector<Vector> x(s_.size(), fixed);
    if (!networks_.hasEncoder()) return x;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      const std::size_t k = b * rows_.size() / s_.size();
      const LatentPosterior q = posterior(p, k);
      for (std::size_t j = 0; j < 3; ++j) {
        x[b][j] = q.mean[j] + std::sqrt(q.variance[j]) * latent_noise_[k][j];
      }
    }
    return x;
  }

  // mean over the contexts
  double kl(const Vector& p) const {
    double sum = 0;
    for (std::size_t k = 0; k < rows_.size(); ++k) sum += klToPrior(posterior(p, k));
    return sum / static_cast<double>(rows_.size());
  }

  LatentPosterior posterior(const Vector& p, std::size_t context) const {
    LatentPosterior q{Vector(3, 0.0), Vector(3, 0.0)};
    for (const Vector& row : rows_[context]) {
      const Vector heads =
          outputs(networks_.encoder().network(), p.data() + networks_.encoderOffset(), row);
      for (std::size_t j = 0; j < 3; ++j) {
        const double precision = 1 / std::log(1 + std::exp(heads[3 + j]));
        q.variance[j] += precision;
        q.mean[j] += precision * heads[j];
      }
    }
    for (std::size_t j = 0; j < 3; ++j) {
      q.variance[j] = 1 / q.variance[j];
      q.mean[j] *= q.variance[j];
    }
    return q;
  }

  double q(int k, const double* theta, const Vector& s, const Vector& x, const Vector& a) const {
    return outputs(networks_.critic(k), theta, concatenated({s, x, a}))[0];
  }

  // a ~ pi with row b's noise, and log pi(a)
  Vector action(const Vector& p, const Vector& s, const Vector& x, std::size_t b,
                double& log_prob) const {
    const Vector heads = outputs(networks_.actor(), p.data(), concatenated({s, x}));
    Vector a(2);
    log_prob = 0;
    for (std::size_t j = 0; j < 2; ++j) {
      const double log_std = std::min(std::max(heads[2 + j], -5.0), 2.0), e = noise_[b][j];
      a[j] = std::tanh(heads[j] + std::exp(log_std) * e);
      log_prob += -0.5 * e * e - log_std - 0.5 * std::log(2 * M_PI) - std::log(1 - a[j] * a[j]);
    }
    return a;
  }

  // y of every sample: terminal by what the environment says, never by its horizon
  Vector y(const Vector& p) const {
    const std::vector<Vector> x = inputs(p);
    Vector result;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      double log_prob = 0;
      const Vector a = action(p, next_[b], x[b], s_.size() + b, log_prob);
      const double q1 = q(0, targets_.data(), next_[b], x[b], a);
      const double q2 = q(1, targets_.data() + networks_.critic(0).size(), next_[b], x[b], a);
      const bool terminal = std::abs(next_[b][0]) > 2.5;
      result.push_back(1.5 * rewards_[b] +
                       (terminal ? 0 : 0.9) * (std::min(q1, q2) - alpha_ * log_prob));
    }
    return result;
  }

  double criticLoss(int k, const Vector& p, const std::vector<Vector>& x, const Vector& y) const {
    double sum = 0;
    for (std::size_t b = 0; b < y.size(); ++b) {
      const double e = q(k, p.data() + networks_.criticOffset(k), s_[b], x[b], a_[b]) - y[b];
      sum += e * e;
    }
    return sum / static_cast<double>(y.size());
  }

  // with the critics of p as well
  double actorLoss(const Vector& p, const std::vector<Vector>& x,
                   double* mean_log_prob = nullptr) const {
    double sum = 0, log_probs = 0;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      double log_prob = 0;
      const Vector a = action(p, s_[b], x[b], b, log_prob);
      const double q1 = q(0, p.data() + networks_.criticOffset(0), s_[b], x[b], a);
      const double q2 = q(1, p.data() + networks_.criticOffset(1), s_[b], x[b], a);
      sum += alpha_ * log_prob - std::min(q1, q2);
      log_probs += log_prob;
    }
    const auto n = static_cast<double>(s_.size());
    if (mean_log_prob != nullptr) *mean_log_prob = log_probs / n;
    return sum / n;
  }

 private:
  // the rows of one context: of a window from the oldest kept transition on, or of all
  std::vector<Vector> context(Rng& rng) const {
    const ReplayBuffer& kept = learner_.context();
    std::vector<std::size_t> slots(kept.size());
    std::iota(slots.begin(), slots.end(), 0);
    const auto window = static_cast<std::size_t>(settings_.context.window);
    if (window > 0) {
      std::rotate(slots.begin(),
                  slots.begin() + static_cast<std::ptrdiff_t>(kept.next() % kept.size()),
                  slots.end());
      slots.erase(slots.begin(),
                  slots.begin() + static_cast<std::ptrdiff_t>(rng.below(kept.size() - window + 1)));
      slots.resize(window);
    }
    std::vector<Vector> rows;
    for (int i = 0; i < settings_.context.batch_size; ++i) {
      const Transition t = kept[slots[rng.below(slots.size())]];
      rows.push_back(concatenated({Vector(t.observation, t.observation + 3),
                                   Vector(t.action, t.action + 2), Vector{t.reward}}));
    }
    return rows;
  }

  const SacLearner& learner_;
  const SacNetworks& networks_;
  SacSettings settings_;
  double alpha_;
  Vector targets_;
  std::vector<std::vector<Vector>> rows_;  // of each context
  std::vector<Vector> latent_noise_, s_, a_, next_, noise_;
  Vector rewards_;
};

void expectGradient(const std::vector<float>& gradient, std::size_t offset, std::size_t n, Vector p,
                    const std::function<double(const Vector&)>& loss) {
  double largest = 0;
  for (std::size_t k = offset; k < offset + n; ++k) {
    largest = std::max<double>(largest, std::abs(gradient[k]));
  }
  ASSERT_GT(largest, 1e-3);
  for (std::size_t k = offset; k < offset + n; ++k) {
    const double h = 1e-6, at = p[k];
    p[k] = at + h;
    const double above = loss(p);
    p[k] = at - h;
    const double below = loss(p);
    p[k] = at;
    ASSERT_NEAR(gradient[k], (above - below) / (2 * h), 2e-4 * largest) << k;
  }
}

class SacGradients : public ::testing::TestWithParam<const char*> {};

TEST_P(SacGradients, AreTheLossesByFiniteDifferences) {
  const bool windows = GetParam() == std::string("inference_by_windows");
  SacSettings settings = smallSettings(windows ? "inference" : GetParam());
  if (windows) {
    settings.context.window = 12;
    settings.context.per_update = 3;
  }
  Trainer trainer(settings);
  const SacNetworks& networks = trainer.learner.networks();
  for (int i = 0; i < 30; ++i) trainer.update();  // targets that differ from the critics
  for (int i = 0; i < 3; ++i) {
    trainer.learner.collect(trainer.parameters.data(), trainer.rng);
    const Reference reference(trainer.learner, trainer.rng);
    const Vector before(trainer.parameters.begin(), trainer.parameters.end());
    const SacLosses losses =
        trainer.learner.update(trainer.parameters.data(), trainer.optimizer, trainer.rng);
    const std::vector<float>& gradient = trainer.optimizer.gradient;

    const Vector y = reference.y(before);
    const std::vector<Vector> x = reference.inputs(before);
    double critic_loss = 0;
    for (int k = 0; k < 2; ++k) {
      critic_loss += 0.5 * reference.criticLoss(k, before, x, y);
      expectGradient(gradient, networks.criticOffset(k), networks.critic(k).size(), before,
                     [&](const Vector& p) { return reference.criticLoss(k, p, x, y); });
    }
    EXPECT_NEAR(losses.critic, critic_loss, 1e-4 * critic_loss);

    if (networks.hasEncoder()) {
      expectGradient(gradient, networks.encoderOffset(), networks.encoder().network().size(),
                     before, [&](const Vector& p) {
                       const std::vector<Vector> z = reference.inputs(p);
                       return reference.criticLoss(0, p, z, y) + reference.criticLoss(1, p, z, y) +
                              0.1 * reference.kl(p);
                     });
      EXPECT_NEAR(losses.kl, reference.kl(before), 1e-4 * losses.kl);
    }

    // the actor's step sees the critics that have moved
    Vector moved(trainer.parameters.begin(), trainer.parameters.end());
    std::copy_n(before.begin(), networks.actor().size(), moved.begin());
    double mean_log_prob = 0;
    EXPECT_NEAR(losses.actor, reference.actorLoss(moved, x, &mean_log_prob), 1e-4);
    EXPECT_NEAR(losses.entropy, -mean_log_prob, 1e-4);
    expectGradient(gradient, 0, networks.actor().size(), moved,
                   [&](const Vector& p) { return reference.actorLoss(p, x); });
  }
}

INSTANTIATE_TEST_SUITE_P(Encodings, SacGradients,
                         ::testing::Values("none", "one_hot", "inference", "inference_by_windows"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Sac, CriticsThenEncoderThenActorMoveAndTargetsFollowTheCritics) {
  Trainer trainer(smallSettings("inference"));
  trainer.update();
  const AlignedFloats targets = trainer.learner.targets();
  trainer.optimizer.offsets.clear();
  trainer.update();
  const SacNetworks& networks = trainer.learner.networks();
  EXPECT_EQ(trainer.optimizer.offsets,
            (std::vector<std::size_t>{networks.criticOffset(0), networks.criticOffset(1),
                                      networks.encoderOffset(), 0}));
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const float theta = trainer.parameters[networks.criticOffset(0) + k];
    EXPECT_NEAR(trainer.learner.targets()[k], targets[k] + 0.05 * (theta - targets[k]), 1e-6);
  }
}

TEST(Sac, TemperatureFollowsTheActorsBatch) {
  Trainer trainer(smallSettings());
  Temperature expected({}, 2);
  for (int i = 0; i < 20; ++i) {
    const SacLosses losses = trainer.update();
    expected.update(-losses.entropy);
    EXPECT_DOUBLE_EQ(losses.temperature, expected.value());
  }
}

TEST(Sac, StoresWhatHappenedAndTheHorizonIsNotTerminal) {
  Trainer trainer(smallSettings());
  for (int i = 0; i < 400; ++i) trainer.update();
  const ReplayBuffer& replay = trainer.learner.replay();
  ASSERT_EQ(replay.size(), 440u);
  int limits = 0, terminals = 0;
  for (std::size_t k = 0; k < replay.size(); ++k) {
    const Transition t = replay[k];
    EXPECT_NEAR(t.reward,
                -t.next_observation[0] * t.next_observation[0] - 0.1 * t.action[1] * t.action[1],
                1e-5);
    EXPECT_NEAR(t.next_observation[2], t.observation[2] + 0.1f, 1e-6) << "within one episode";
    const bool terminal = std::abs(t.next_observation[0]) > 2.5f;
    EXPECT_EQ(t.discount, terminal ? 0.0f : 0.9f);
    terminals += terminal;
    limits += !terminal && t.next_observation[2] > 1.15f;
  }
  EXPECT_GT(limits, 0);
  EXPECT_GT(terminals, 0);
}

TEST(Sac, WarmsUpUniformlyThenSamplesItsPolicy) {
  SacSettings settings = smallSettings();
  settings.warm_up_steps = 4000;
  settings.env_steps_per_update = 4000;
  settings.buffer_size = 10000;
  Trainer trainer(settings);
  // a policy of small deviations around tanh(1) = 0.76 and tanh(-1)
  std::fill_n(trainer.parameters.begin(), trainer.learner.networks().actor().size(), 0.0f);
  const float biases[] = {1, -1, -2, -2};
  std::copy_n(biases, 4, &trainer.parameters[trainer.learner.networks().actor().size() - 4]);
  EXPECT_EQ(trainer.learner.collect(trainer.parameters.data(), trainer.rng), 8000);
  const ReplayBuffer& replay = trainer.learner.replay();
  std::vector<int> counts(10);
  double sums[2] = {};
  for (std::size_t k = 0; k < 8000; ++k) {
    for (int j = 0; j < 2; ++j) {
      const float a = replay[k].action[j];
      if (k < 4000) {
        ++counts[static_cast<std::size_t>(5 * (a + 1))];
      } else {
        sums[j] += std::atanh(double{a}) / 4000;
      }
    }
  }
  EXPECT_LT(test::chiSquare(counts), 33.7);  // 99.99 %
  EXPECT_NEAR(sums[0], 1, 4 * std::exp(-2.0) / std::sqrt(4000));
  EXPECT_NEAR(sums[1], -1, 4 * std::exp(-2.0) / std::sqrt(4000));
}

TEST(Sac, ContextIsWarmUpAndPriorEpisodesInTheRewardThatCounts) {
  SacSettings settings = smallSettings("inference");
  settings.context.prior_interval = 3;
  settings.context.buffer_size = 100000;
  settings.buffer_size = 100000;
  Trainer trainer(settings);
  for (int i = 0; i < 2000; ++i) {
    trainer.learner.collect(trainer.parameters.data(), trainer.rng);
  }
  const ReplayBuffer &replay = trainer.learner.replay(), &context = trainer.learner.context();
  // walk through the replay and say which transitions should be context
  std::size_t at = 0;
  int episode = 0;  // after the warm-up's last
  bool prior = true;
  for (std::size_t k = 0; k < replay.size(); ++k) {
    const Transition t = replay[k];
    if (k > 0 && t.observation[2] == 0) {
      prior = k <= 40 || episode % 3 == 0;
      episode += k <= 40 ? 0 : 1;
    }
    if (!prior) continue;
    ASSERT_LT(at, context.size());
    const Transition c = context[at++];
    ASSERT_EQ(c.observation[0], t.observation[0]) << k;
    EXPECT_EQ(c.reward, t.action[0]) << "the sparse reward";
  }
  EXPECT_EQ(at, context.size());
  EXPECT_LT(context.size(), replay.size() / 2);
}

TEST(Sac, PosteriorEpisodesAreContextWhereAskedFor) {
  SacSettings settings = smallSettings("inference");
  settings.context.prior_interval = 3;
  settings.context.posterior_episodes = true;
  settings.context.buffer_size = settings.buffer_size;
  Trainer trainer(settings);
  for (int i = 0; i < 200; ++i) {
    trainer.learner.collect(trainer.parameters.data(), trainer.rng);
  }
  const ReplayBuffer &replay = trainer.learner.replay(), &context = trainer.learner.context();
  ASSERT_EQ(context.size(), replay.size());
  for (std::size_t k = 0; k < replay.size(); ++k) {
    ASSERT_EQ(context[k].observation[0], replay[k].observation[0]) << k;
    EXPECT_EQ(context[k].reward, replay[k].action[0]) << "the sparse reward";
  }
}

TEST(Sac, RefusesMoreContextsThanTheBatchHasRows) {
  SacSettings settings = smallSettings("inference");
  settings.context.per_update = settings.batch_size + 1;
  EXPECT_EQ(test::errorOf([&] { Trainer trainer(settings); }),
            "soft actor-critic cannot share a batch of 16 transitions among 17 contexts: "
            "contexts_per_update is at most batch_size.");
  settings.task_encoding = "none";
  EXPECT_NO_THROW(Trainer trainer(settings));
}

TEST(Sac, TheExplorerActsInPriorEpisodesOnly) {
  SacSettings settings = smallSettings("inference");
  settings.context.buffer_size = 1000;
  Trainer trainer(settings);
  const SacLearner& learner = trainer.learner;
  const SacNetworks& networks = learner.networks();
  const std::vector<float> explorer(networks.actor().size(), 0.1f);
  SacNetworks::ActorWorkspace workspace(networks, 1);
  GaussianPolicy policy(networks.actionSize(), 1);
  trainer.learner.collect(trainer.parameters.data(), trainer.rng, explorer.data());
  int in_prior = 0;
  for (int i = 0; i < 400; ++i) {
    const std::vector<float> z = learner.taskInput();
    const std::size_t context = learner.context().size();
    Rng same = trainer.rng;
    trainer.learner.collect(trainer.parameters.data(), trainer.rng, explorer.data());
    const bool prior = learner.context().size() > context;
    in_prior += prior;
    const Transition t = learner.replay()[learner.replay().size() - 1];
    policy.sample(networks.heads(prior ? explorer.data() : trainer.parameters.data(), t.observation,
                                 1, z.data(), workspace),
                  1, same);
    for (std::size_t j = 0; j < networks.actionSize(); ++j) {
      ASSERT_EQ(t.action[j], policy.actions()[j]) << "step " << i << (prior ? ", prior" : "");
    }
  }
  EXPECT_GT(in_prior, 100);
  EXPECT_LT(in_prior, 300);
}

TEST(Sac, GreedyActionsAreTanhOfTheMean) {
  const Trainer trainer(smallSettings("one_hot"));
  const SacNetworks& networks = trainer.learner.networks();
  const std::vector<float> observations = {0.1f, 0.2f, 0.3f, -1, 1, 0.5f};
  SacNetworks::ActorWorkspace workspace(networks, 2);
  double actions[4];
  networks.greedyActions(trainer.parameters.data(), observations.data(), 2,
                         trainer.learner.taskInput().data(), workspace, actions);
  for (std::size_t b = 0; b < 2; ++b) {
    const Vector heads =
        outputs(networks.actor(), trainer.parameters.data(),
                {observations[3 * b], observations[3 * b + 1], observations[3 * b + 2], 0, 1, 0});
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(actions[2 * b + j], std::tanh(heads[j]), 1e-6);
    }
  }
}

TEST(Sac, OneSeedOneResult) {
  for (const char* encoding : {"none", "inference"}) {
    Trainer a(smallSettings(encoding), 7), b(smallSettings(encoding), 7),
        c(smallSettings(encoding), 8);
    for (int i = 0; i < 50; ++i) {
      EXPECT_EQ(a.update().critic, b.update().critic);
      c.update();
    }
    EXPECT_EQ(a.parameters, b.parameters);
    EXPECT_EQ(a.learner.targets(), b.learner.targets());
    EXPECT_NE(a.parameters, c.parameters);
  }
}

TEST(Sac, GoesOnFromItsState) {
  for (const char* encoding : {"one_hot", "inference"}) {
    SacSettings settings = smallSettings(encoding);
    settings.buffer_size = 100;  // turned over
    Trainer a(settings, 7), b(settings, 9);
    for (int i = 0; i < 90; ++i) a.update();
    test::load(b.learner, test::stateOf(a.learner));
    b.parameters = a.parameters;
    b.rng = a.rng;
    for (int i = 0; i < 40; ++i) EXPECT_EQ(a.update().actor, b.update().actor);
    EXPECT_EQ(a.parameters, b.parameters);
    EXPECT_EQ(a.learner.updates(), b.learner.updates());
  }
}

TEST(Sac, UpdatesAndStepsAllocateNothing) {
  for (const char* encoding : {"none", "one_hot", "inference"}) {
    Trainer trainer(smallSettings(encoding));
    trainer.optimizer.offsets.reserve(10000);
    trainer.update();
    const std::size_t before = test::allocations();
    for (int i = 0; i < 1100; ++i) trainer.update();  // fills the replay and turns it over
    EXPECT_EQ(test::allocations() - before, 0u) << encoding;
    EXPECT_EQ(trainer.learner.replay().size(), 1000u);
  }
}

// a point that moves by 0.2 a; reward -|x|; from +-1 the best return is -(0.8 + 0.6 + 0.4 + 0.2)
class WayHome : public Env {
 public:
  WayHome() {
    spec_.name = "way_home";
    spec_.observation_size = 1;
    spec_.action_size = 1;
    spec_.horizon = 15;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    x_ = rng.uniform() < 0.5 ? -1 : 1;
    t_ = 0;
    observation[0] = x_;
  }
  Step step(const double* action, Rng&, double* observation) override {
    x_ += 0.2 * action[0];
    observation[0] = x_;
    return {-std::abs(x_), false, ++t_ == spec_.horizon};
  }

 private:
  EnvSpec spec_;
  double x_ = 0;
  int t_ = 0;
};

// mean return of tanh(mean) over some episodes
double greedyReturn(const SacNetworks& networks, const float* parameters, Env& env,
                    const std::vector<float>& task_input) {
  SacNetworks::ActorWorkspace workspace(networks, 1);
  Rng rng(3, 0, Stream::kEvaluate);
  std::vector<double> observation(networks.observationSize()), action(networks.actionSize());
  double sum = 0;
  for (int episode = 0; episode < 10; ++episode) {
    Step step;
    env.reset(rng, observation.data());
    while (!step.terminated && !step.truncated) {
      const std::vector<float> seen(observation.begin(), observation.end());
      networks.greedyActions(parameters, seen.data(), 1, task_input.data(), workspace,
                             action.data());
      step = env.step(action.data(), rng, observation.data());
      sum += step.reward / 10;
    }
  }
  return sum;
}

TEST(Sac, FindsTheWayHome) {
  SacSettings settings;
  settings.hidden = {32, 32};
  settings.batch_size = 64;
  settings.warm_up_steps = 300;
  settings.gamma = 0.95;
  settings.task_encoding = "none";
  SacLearner learner(std::make_unique<WayHome>(), settings);
  AlignedFloats parameters(learner.networks().size());
  Rng initial(0, 0, Stream::kInitialise), rng(0, 0, Stream::kSample);
  learner.networks().initialise(parameters.data(), initial);
  learner.resetTargets(parameters.data());
  ProximalAdamSettings adam;
  adam.learning_rate = 3e-3;
  ProximalAdam optimizer(parameters.data(), nullptr, parameters.size(), adam);
  WayHome env;
  EXPECT_LT(greedyReturn(learner.networks(), parameters.data(), env, {}), -5);
  for (int i = 0; i < 2000; ++i) {
    learner.collect(parameters.data(), rng);
    optimizer.beginUpdate();
    learner.update(parameters.data(), optimizer, rng);
  }
  EXPECT_GT(greedyReturn(learner.networks(), parameters.data(), env, {}), -2.4);
  EXPECT_LT(learner.temperature().value(), 0.2);
}

TEST(Sac, RefusesWhatItCannotDo) {
  class Discrete : public PushedPoint {
   public:
    Discrete() : spec_(PushedPoint().spec()) { spec_.num_actions = 3; }
    const EnvSpec& spec() const override { return spec_; }

   private:
    EnvSpec spec_;
  };
  EXPECT_EQ(
      test::errorOf([] { SacLearner(std::make_unique<Discrete>(), smallSettings()); }),
      "environment 'pushed_point' has discrete actions: soft actor-critic needs continuous ones.");
  EXPECT_EQ(test::errorOf(
                [] { SacLearner(std::make_unique<PushedPoint>(), smallSettings(), oneHot(0, 2)); }),
            "soft actor-critic takes a task input of 2 numbers with task_encoding 'none': give the "
            "one-hot vector with one_hot, and nothing otherwise.");
  EXPECT_EQ(test::errorOf([] { oneHot(3, 3); }), "task 3 is none of 3.");
  Trainer trainer(smallSettings());
  EXPECT_EQ(test::errorOf([&] {
              trainer.learner.update(trainer.parameters.data(), trainer.optimizer, trainer.rng);
            }),
            "call collect() before soft actor-critic's update().");
  EXPECT_NE(test::errorOf([&] {
              trainer.learner.contextPosterior(trainer.parameters.data());
            }).find("no context encoder"),
            std::string::npos);
}

TEST(Sac, SettingsAreBoundBelowTheirPrefix) {
  SacSettings settings;
  Settings table;
  bind(table, "sac.", settings);
  table.assign("sac.hidden:=[32,16]");
  table.assign("temperature:=fixed");
  table.assign("task_encoding:=inference");
  table.assign("sac.context_hidden:=[20]");
  table.assign("latent_size:=3");
  EXPECT_EQ(settings.hidden, (std::vector<int>{32, 16}));
  EXPECT_EQ(settings.temperature.temperature, "fixed");
  EXPECT_EQ(settings.task_encoding, "inference");
  EXPECT_EQ(settings.context.hidden, std::vector<int>{20});
  EXPECT_EQ(settings.context.latent_size, 3);
  EXPECT_NE(test::errorOf([&] { table.assign("sac.tau:=0"); }).find("sac.tau"), std::string::npos);
}

}  // namespace
}  // namespace pmeta
