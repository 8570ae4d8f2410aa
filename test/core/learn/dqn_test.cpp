#include "pmeta_core/learn/dqn.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "../support.h"

namespace pmeta {
namespace {

// a point on a line that the three actions push; random pushes on top; obs = (x, x^2, time)
class Line : public Env {
 public:
  Line() {
    spec_.name = "line";
    spec_.observation_size = 3;
    spec_.action_size = 1;
    spec_.num_actions = 3;
    spec_.horizon = 12;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    x_ = rng.normal();
    t_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    x_ += 0.5 * (action[0] - 1) + 0.3 * rng.normal();
    ++t_;
    observe(observation);
    return {-x_ * x_, std::abs(x_) > 2.5, t_ == spec_.horizon};
  }

 private:
  void observe(double* observation) const {
    observation[0] = x_;
    observation[1] = x_ * x_;
    observation[2] = 0.1 * t_;
  }
  EnvSpec spec_;
  double x_ = 0;
  int t_ = 0;
};

std::vector<std::unique_ptr<Env>> lines(int n) {
  std::vector<std::unique_ptr<Env>> envs;
  for (int i = 0; i < n; ++i) envs.push_back(std::make_unique<Line>());
  return envs;
}

DqnSettings smallSettings() {
  DqnSettings settings;
  settings.hidden = {8, 6};
  settings.batch_size = 16;
  settings.buffer_size = 1000;
  settings.num_envs = 3;
  settings.warm_up_steps = 40;
  settings.target_update_interval = 5;
  return settings;
}

// plain descent that keeps the last gradient
class Descent : public Optimizer<float> {
 public:
  Descent(AlignedFloats& parameters, float rate) : parameters_(parameters), rate_(rate) {
    gradient.resize(parameters.size());
  }
  void move(std::size_t offset, const float* g, std::size_t n, float*, double) override {
    for (std::size_t k = 0; k < n; ++k) {
      gradient[offset + k] = g[k];
      parameters_[offset + k] -= rate_ * g[k];
    }
  }
  std::vector<float> gradient;

 private:
  AlignedFloats& parameters_;
  float rate_;
};

struct Trainer {
  explicit Trainer(const DqnSettings& settings, std::uint64_t seed = 0, float rate = 0.05f)
      : learner(lines(settings.num_envs), settings, 1000),
        parameters(learner.network().size()),
        optimizer(parameters, rate),
        rng(seed, 0, Stream::kSample) {
    Rng initial(seed, 0, Stream::kInitialise);
    learner.network().initialise(parameters.data(), initial);
    learner.resetTargets(parameters.data());
  }
  double update() {
    learner.collect(parameters.data(), rng);
    return learner.update(parameters.data(), optimizer, rng);
  }
  DqnLearner learner;
  AlignedFloats parameters;
  Descent optimizer;
  Rng rng;
};

// Q-values of one observation in double precision, from the blocks' names and shapes
template <class Scalar>
std::vector<double> qValues(const Mlp& network, const Scalar* parameters, const float* observation,
                            std::size_t observation_size) {
  std::vector<double> x(observation, observation + observation_size);
  const std::vector<Block> blocks = network.blocks();
  for (std::size_t l = 0; l < blocks.size(); l += 2) {
    const std::size_t outputs = blocks[l].shape[0], inputs = blocks[l].shape[1];
    const Scalar* weight = parameters;
    const Scalar* bias = parameters + outputs * inputs;
    std::vector<double> y(outputs);
    for (std::size_t j = 0; j < outputs; ++j) {
      y[j] = bias[j];
      for (std::size_t i = 0; i < inputs; ++i) y[j] += weight[j * inputs + i] * x[i];
      if (l + 2 < blocks.size()) y[j] = std::max(y[j], 0.0);
    }
    parameters += outputs * (inputs + 1);
    x = y;
  }
  return x;
}

std::size_t argmax(const std::vector<double>& values) {
  return std::max_element(values.begin(), values.end()) - values.begin();
}

// y of every sample, by the equations
std::vector<double> tdTargets(const DqnLearner& learner, const DqnSettings& settings,
                              const AlignedFloats& parameters, const ReplayBatch& batch) {
  std::vector<double> targets;
  const std::size_t n = learner.network().size();
  for (std::size_t b = 0; b < batch.slots.size(); ++b) {
    const float* next = &batch.next_observations[3 * b];
    std::vector<double> mean(3, 0.0);
    for (int k = 0; k < settings.averaged_targets; ++k) {
      const auto q = qValues(learner.network(), &learner.targets()[k * n], next, 3);
      for (std::size_t a = 0; a < 3; ++a) mean[a] += q[a] / settings.averaged_targets;
    }
    const std::size_t action = settings.double_q
                                   ? argmax(qValues(learner.network(), parameters.data(), next, 3))
                                   : argmax(mean);
    targets.push_back(batch.rewards[b] + batch.discounts[b] * mean[action]);
  }
  return targets;
}

double lossOf(const Mlp& network, const std::vector<double>& parameters, const ReplayBatch& batch,
              const std::vector<double>& targets, bool huber) {
  double loss = 0;
  for (std::size_t b = 0; b < targets.size(); ++b) {
    const auto q = qValues(network, parameters.data(), &batch.observations[3 * b], 3);
    const double td = q[static_cast<std::size_t>(batch.actions[b])] - targets[b];
    const double square = huber ? 0.5 * td * td : td * td;
    loss += batch.weights[b] * (huber && std::abs(td) > 1 ? std::abs(td) - 0.5 : square);
  }
  return loss / static_cast<double>(targets.size());
}

struct GradientCase {
  const char* name;
  bool double_q;
  bool huber;
  int averaged_targets;
  double alpha;
};

class DqnGradient : public ::testing::TestWithParam<GradientCase> {};

TEST_P(DqnGradient, IsTheLosssByFiniteDifferences) {
  DqnSettings settings = smallSettings();
  settings.double_q = GetParam().double_q;
  settings.huber = GetParam().huber;
  settings.averaged_targets = GetParam().averaged_targets;
  settings.priority_alpha = GetParam().alpha;
  Trainer trainer(settings);
  for (int i = 0; i < 22; ++i) trainer.update();  // target networks that differ

  for (int i = 0; i < 3; ++i) {
    trainer.learner.collect(trainer.parameters.data(), trainer.rng);
    const AlignedFloats before = trainer.parameters;
    Rng same = trainer.rng;
    ReplayBatch batch;
    trainer.learner.replay().sample(settings.batch_size, same, batch);
    const auto targets = tdTargets(trainer.learner, settings, before, batch);
    const double loss =
        trainer.learner.update(trainer.parameters.data(), trainer.optimizer, trainer.rng);

    const Mlp& network = trainer.learner.network();
    std::vector<double> theta(before.begin(), before.end());
    EXPECT_NEAR(loss, lossOf(network, theta, batch, targets, settings.huber), 1e-4 * loss);
    double largest = 0;
    for (const float g : trainer.optimizer.gradient)
      largest = std::max<double>(largest, std::abs(g));
    ASSERT_GT(largest, 0.01);
    for (std::size_t k = 0; k < theta.size(); ++k) {
      const double h = 1e-6;
      theta[k] += h;
      const double above = lossOf(network, theta, batch, targets, settings.huber);
      theta[k] -= 2 * h;
      const double below = lossOf(network, theta, batch, targets, settings.huber);
      theta[k] += h;
      ASSERT_NEAR(trainer.optimizer.gradient[k], (above - below) / (2 * h), 1e-4 * largest) << k;
    }

    for (std::size_t b = 0; b < batch.slots.size(); ++b) {
      const auto q = qValues(network, before.data(), &batch.observations[3 * b], 3);
      const double td = q[static_cast<std::size_t>(batch.actions[b])] - targets[b];
      EXPECT_NEAR(trainer.learner.replay().tree().get(batch.slots[b]),
                  std::pow(std::abs(td) + 1e-6, settings.priority_alpha), 1e-3);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Variants, DqnGradient,
                         ::testing::Values(GradientCase{"Plain", false, false, 1, 0.6},
                                           GradientCase{"Double", true, false, 1, 0.6},
                                           GradientCase{"Huber", false, true, 1, 0.6},
                                           GradientCase{"Averaged", false, false, 3, 0.6},
                                           GradientCase{"AveragedDouble", true, true, 4, 0.6},
                                           GradientCase{"Uniform", false, false, 1, 0.0}),
                         [](const auto& info) { return info.param.name; });

TEST(Dqn, TargetNetworkFollowsAtEveryIntervalOnly) {
  Trainer trainer(smallSettings());
  AlignedFloats target = trainer.parameters;
  for (int update = 1; update <= 23; ++update) {
    EXPECT_EQ(trainer.learner.updates(), update - 1);
    trainer.update();
    if (update % 5 == 0) target = trainer.parameters;
    ASSERT_EQ(trainer.learner.targets(), target) << "after update " << update;
    EXPECT_EQ(trainer.parameters == target, update % 5 == 0);
  }
}

TEST(Dqn, AveragedTargetsAreTheLastOnes) {
  DqnSettings settings = smallSettings();
  settings.averaged_targets = 3;
  Trainer trainer(settings);
  const std::size_t n = trainer.parameters.size();
  std::vector<AlignedFloats> copies(3, trainer.parameters);
  for (int update = 1; update <= 40; ++update) {
    trainer.update();
    if (update % 5 == 0) copies.push_back(trainer.parameters);
    std::vector<AlignedFloats> expected(copies.end() - 3, copies.end()), found;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto first = trainer.learner.targets().begin() + static_cast<std::ptrdiff_t>(k * n);
      found.emplace_back(first, first + static_cast<std::ptrdiff_t>(n));
    }
    std::sort(expected.begin(), expected.end());
    std::sort(found.begin(), found.end());
    ASSERT_EQ(found, expected) << "after update " << update;
  }
}

TEST(Dqn, CollectsOneStepInEachEnvironmentAfterTheWarmUp) {
  DqnSettings settings = smallSettings();
  settings.n_step = 1;
  settings.env_steps_per_update = 2;
  Trainer trainer(settings);
  EXPECT_EQ(trainer.learner.collect(trainer.parameters.data(), trainer.rng), 3 * (40 + 2));
  EXPECT_EQ(trainer.learner.replay().size(), 3u * 42);
  EXPECT_EQ(trainer.learner.collect(trainer.parameters.data(), trainer.rng), 3 * 2);
  EXPECT_EQ(trainer.learner.replay().size(), 3u * 44);
}

TEST(Dqn, ActsGreedilyButForEpsilon) {
  DqnSettings settings = smallSettings();
  settings.n_step = 1;
  settings.buffer_size = 30000;
  settings.epsilon_finish = settings.epsilon_start = 0.3;
  Trainer trainer(settings);
  trainer.learner.collect(trainer.parameters.data(), trainer.rng);
  const std::size_t first = trainer.learner.replay().size();
  for (int i = 0; i < 5000; ++i) trainer.learner.collect(trainer.parameters.data(), trainer.rng);
  const ReplayBuffer& buffer = trainer.learner.replay().buffer();
  std::vector<int> random(3);
  int greedy = 0, steps = 0;
  for (std::size_t k = 0; k < first; ++k) ++random[static_cast<int>(buffer[k].action[0])];
  for (std::size_t k = first; k < buffer.size(); ++k) {
    const auto q =
        qValues(trainer.learner.network(), trainer.parameters.data(), buffer[k].observation, 3);
    greedy += argmax(q) == static_cast<std::size_t>(buffer[k].action[0]);
    ++steps;
  }
  EXPECT_LT(test::chiSquare(random), 18.4) << "warm-up is uniform";  // 99.99 %
  // 1 - epsilon + epsilon / 3 of 15000, within 4 deviations
  EXPECT_NEAR(static_cast<double>(greedy) / steps, 0.8, 4 * std::sqrt(0.8 * 0.2 / steps));
}

TEST(Dqn, EpsilonFallsOverItsShareOfAllUpdates) {
  DqnSettings settings = smallSettings();
  settings.epsilon_fraction = 0.02;  // of 1000 updates
  Trainer trainer(settings);
  EXPECT_EQ(trainer.learner.epsilon(), 0.3);
  for (int i = 0; i < 10; ++i) trainer.update();
  EXPECT_NEAR(trainer.learner.epsilon(), 0.155, 1e-12);
  for (int i = 0; i < 15; ++i) trainer.update();
  EXPECT_NEAR(trainer.learner.epsilon(), 0.01, 1e-12);
}

TEST(Dqn, StoresWhatHappened) {
  DqnSettings settings = smallSettings();
  settings.n_step = 1;
  settings.gamma = 0.9;
  for (const bool bootstrap : {true, false}) {
    settings.bootstrap_at_limit = bootstrap;
    Trainer trainer(settings);
    for (int i = 0; i < 100; ++i) trainer.update();
    const ReplayBuffer& buffer = trainer.learner.replay().buffer();
    int limits = 0, terminals = 0;
    for (std::size_t k = 0; k < buffer.size(); ++k) {
      const Transition t = buffer[k];
      EXPECT_NEAR(t.reward, -t.next_observation[0] * t.next_observation[0], 1e-5);
      EXPECT_NEAR(t.next_observation[2], t.observation[2] + 0.1f, 1e-6) << "within one episode";
      const bool terminal = std::abs(t.next_observation[0]) > 2.5f;
      const bool limit = !terminal && t.next_observation[2] > 1.15f;
      EXPECT_EQ(t.discount, terminal || (limit && !bootstrap) ? 0.0f : 0.9f);
      terminals += terminal;
      limits += limit;
    }
    EXPECT_GT(limits, 0);
    EXPECT_GT(terminals, 0);
  }
}

// every second episode breaks down in its fifth step
class Breaking : public Line {
 public:
  void reset(Rng& rng, double* observation) override {
    ++episode_;
    Line::reset(rng, observation);
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    const Step step = Line::step(action, rng, observation);
    if (episode_ % 2 == 0 && observation[2] > 0.45) throw BrokenEpisode("line: it broke");
    return step;
  }

 private:
  int episode_ = 0;
};

TEST(Dqn, NoTransitionGoesFromABrokenEpisodeIntoTheNext) {
  DqnSettings settings = smallSettings();
  settings.n_step = 3;
  DqnLearner learner(makeEnvs([](int) { return std::make_unique<Breaking>(); }, 2), settings, 1000);
  AlignedFloats parameters(learner.network().size());
  Rng rng(1, 0, Stream::kSample);
  for (int i = 0; i < 50; ++i) learner.collect(parameters.data(), rng);
  const ReplayBuffer& buffer = learner.replay().buffer();
  ASSERT_GT(buffer.size(), 50u);
  for (std::size_t k = 0; k < buffer.size(); ++k) {
    EXPECT_GT(buffer[k].next_observation[2], buffer[k].observation[2]);
  }
}

TEST(Dqn, OneSeedOneResult) {
  Trainer a(smallSettings(), 7), b(smallSettings(), 7), c(smallSettings(), 8);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(a.update(), b.update());
    c.update();
  }
  EXPECT_EQ(a.parameters, b.parameters);
  EXPECT_NE(a.parameters, c.parameters);
}

TEST(Dqn, RefusesAWarmUpThatFillsNothing) {
  DqnSettings settings = smallSettings();
  settings.warm_up_steps = 2;
  EXPECT_EQ(test::errorOf([&] { DqnLearner(lines(3), settings, 10); }),
            "dqn.warm_up_steps is 2 but dqn.n_step is 3: nothing could be sampled; give at least "
            "as many.");
}

TEST(Dqn, SettingsAreBoundBelowTheirPrefix) {
  DqnSettings settings;
  Settings table;
  bind(table, "dqn.", settings);
  table.assign("dqn.hidden:=[32,16]");
  table.assign("n_step:=10");
  table.assign("double_q:=true");
  EXPECT_EQ(settings.hidden, (std::vector<int>{32, 16}));
  EXPECT_EQ(settings.n_step, 10);
  EXPECT_TRUE(settings.double_q);
  EXPECT_NE(
      test::errorOf([&] { table.assign("dqn.priority_alpha:=2"); }).find("dqn.priority_alpha"),
      std::string::npos);
}

}  // namespace
}  // namespace pmeta
