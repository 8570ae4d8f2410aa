#include "pmeta_core/learn/sac.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "../allocations.h"
#include "../memory_state.h"
#include "../support.h"
#include "pmeta_core/personal/proximal_adam.h"
#include "sac_trainer.h"

namespace pmeta {
namespace {

using test::outputs;
using test::PushedPoint;
using test::smallSettings;
using test::taskInput;
using test::Trainer;
using test::Vector;

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
  const ReplayBuffer &replay = trainer.learner.replay(),
                     &context = trainer.learner.context().kept();
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
  const ReplayBuffer &replay = trainer.learner.replay(),
                     &context = trainer.learner.context().kept();
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
  trainer.learner.collect(trainer.parameters.data(), trainer.rng, explorer.data());
  int in_prior = 0;
  for (int i = 0; i < 400; ++i) {
    const std::vector<float> z = learner.taskInput();
    const std::size_t context = learner.context().kept().size();
    Rng same = trainer.rng;
    trainer.learner.collect(trainer.parameters.data(), trainer.rng, explorer.data());
    const bool prior = learner.context().kept().size() > context;
    in_prior += prior;
    const Transition t = learner.replay()[learner.replay().size() - 1];
    GaussianActor actor(networks.actor(), z, 1, GaussianActor::By::kSample,
                        prior ? explorer.data() : trainer.parameters.data());
    std::vector<double> action(networks.actionSize());
    actor.look(t.observation, {0});
    actor.act(0, same, action.data());
    for (std::size_t j = 0; j < networks.actionSize(); ++j) {
      ASSERT_EQ(t.action[j], action[j]) << "step " << i << (prior ? ", prior" : "");
    }
  }
  EXPECT_GT(in_prior, 100);
  EXPECT_LT(in_prior, 300);
}

TEST(Sac, GreedyActionsAreTanhOfTheMean) {
  const Trainer trainer(smallSettings("one_hot"));
  const SacNetworks& networks = trainer.learner.networks();
  const std::vector<float> observations = {0.1f, 0.2f, 0.3f, -1, 1, 0.5f};
  GaussianActor actor(networks.actor(), trainer.learner.taskInput(), 2, GaussianActor::By::kMean,
                      trainer.parameters.data());
  Rng none(0, 0, Stream::kEvaluate);
  actor.look(observations.data(), {0, 1});
  for (std::size_t b = 0; b < 2; ++b) {
    double action[2];
    EXPECT_TRUE(actor.act(b, none, action));
    const Vector heads =
        outputs(networks.actor(), trainer.parameters.data(),
                {observations[3 * b], observations[3 * b + 1], observations[3 * b + 2], 0, 1, 0});
    for (std::size_t j = 0; j < 2; ++j) EXPECT_NEAR(action[j], std::tanh(heads[j]), 1e-6);
  }
}

TEST(Sac, OneSeedOneResult) {
  for (const char* encoding : {"none", "model", "inference"}) {
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
  for (const char* encoding : {"one_hot", "model", "inference"}) {
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
  for (const char* encoding : {"none", "one_hot", "model", "inference"}) {
    SacSettings settings = smallSettings(encoding);
    settings.task_model.explored_to_replay = true;
    Trainer trainer(settings);
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
  Rng rng(3, 0, Stream::kEvaluate);
  std::vector<double> observation(networks.observationSize());
  double sum = 0;
  for (int episode = 0; episode < 10; ++episode) {
    Step step;
    env.reset(rng, observation.data());
    while (!step.terminated && !step.truncated) {
      const std::vector<float> seen(observation.begin(), observation.end());
      const std::vector<double> action = test::greedyAction(networks, parameters, seen, task_input);
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
            "one-hot vector with one_hot and model, and nothing otherwise.");
  EXPECT_EQ(test::errorOf([] { oneHot(3, 3); }), "task 3 is none of 3.");
  Trainer trainer(smallSettings());
  EXPECT_EQ(test::errorOf([&] {
              trainer.learner.update(trainer.parameters.data(), trainer.optimizer, trainer.rng);
            }),
            "call collect() before soft actor-critic's update().");
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
