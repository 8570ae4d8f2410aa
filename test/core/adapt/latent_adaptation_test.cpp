#include "pmeta_core/adapt/latent_adaptation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "../support.h"
#include "pmeta_core/act/evaluation.h"
#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {
namespace {

// the reward is the action in the task's direction; the observation tells nothing of it
class Direction : public Env {
 public:
  explicit Direction(double direction) : direction_(direction) {
    spec_.name = "direction";
    spec_.observation_size = 1;
    spec_.action_size = 1;
    spec_.horizon = 10;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    t_ = 0;
    observation[0] = start_ = rng.uniform();
  }
  Step step(const double* action, Rng&, double* observation) override {
    if (log != nullptr) log->push_back(action[0]);
    observation[0] = start_;
    Step step{direction_ * action[0], false, ++t_ == spec_.horizon};
    if (sparse) step.sparse_reward = 7;
    return step;
  }
  std::vector<double>* log = nullptr;  // of all actions
  bool sparse = false;

 private:
  EnvSpec spec_;
  double direction_;
  double start_ = 0;
  int t_ = 0;
};

SacSettings smallSettings() {
  SacSettings settings;
  settings.hidden = {24, 24};
  settings.batch_size = 32;
  settings.warm_up_steps = 100;
  settings.gamma = 0.5;
  settings.task_encoding = "inference";
  settings.context.hidden = {16, 16};
  settings.context.latent_size = 2;
  settings.context.batch_size = 20;
  settings.context.buffer_size = 200;
  settings.context.exploration_episodes = {1, 3};
  return settings;
}

// what is known of the task after each episode of exploration
std::vector<std::vector<float>> known(const SacNetworks& networks, const ContextSettings& settings,
                                      const float* parameters, std::unique_ptr<Env> env,
                                      int episodes, Rng rng) {
  std::vector<std::unique_ptr<Env>> envs;
  envs.push_back(std::move(env));
  Evaluation exploration(std::move(envs));
  LatentAdaptation adaptation(networks, settings, parameters);
  EXPECT_EQ(adaptation.taskInput(), std::vector<float>(2)) << "the prior's mean";
  std::vector<std::vector<float>> known;
  for (int episode = 0; episode < episodes; ++episode) {
    adaptation.beginEpisode(rng);
    EXPECT_TRUE(exploration.explore(adaptation, rng));
    adaptation.episodeOver();
    known.push_back(adaptation.taskInput());
  }
  return known;
}

struct Untrained {
  Untrained() : networks(Direction(1).spec(), smallSettings(), 0), parameters(networks.size()) {
    Rng rng(1, 0, Stream::kInitialise);
    networks.initialise(parameters.data(), rng);
  }
  std::vector<std::vector<float>> exploring(std::unique_ptr<Env> env,
                                            const ContextSettings& settings) const {
    return known(networks, settings, parameters.data(), std::move(env), 3,
                 Rng(0, 0, Stream::kEvaluate));
  }
  SacNetworks networks;
  AlignedFloats parameters;
};

TEST(Adapt, ActsOnTheMeanOfThePosteriorOfAllTransitions) {
  const Untrained sac;
  const ContextSettings settings = smallSettings().context;
  std::vector<double> actions;
  auto env = std::make_unique<Direction>(-1);
  env->log = &actions;
  const std::vector<std::vector<float>> found = sac.exploring(std::move(env), settings);
  ASSERT_EQ(actions.size(), 30u);

  // rows (s, a, r) again: starts and actions follow from the same generator
  Rng rng(0, 0, Stream::kEvaluate);
  std::vector<float> rows;
  const ContextEncoder& encoder = sac.networks.encoder();
  ContextEncoder::Workspace workspace(encoder, 30);
  LatentPosterior posterior;
  const auto infer = [&] {
    encoder.infer(sac.parameters.data() + sac.networks.encoderOffset(), rows.data(),
                  rows.size() / 3, workspace, posterior);
  };
  for (int episode = 0; episode < 3; ++episode) {
    for (int j = 0; j < 2; ++j) rng.normal();
    const auto start = static_cast<float>(rng.uniform());
    for (int t = 0; t < 10; ++t) {
      const double action = actions[static_cast<std::size_t>(10 * episode + t)];
      rows.insert(rows.end(), {start, static_cast<float>(action), static_cast<float>(-action)});
    }
    infer();
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(found[static_cast<std::size_t>(episode)][j], posterior.mean[j], 1e-6);
    }
  }
}

TEST(Adapt, ActsByTheMeanUnlessNoiseIsWanted) {
  const Untrained sac;
  ContextSettings settings = smallSettings().context;
  for (const bool noise : {false, true}) {
    settings.exploration_noise = noise;
    std::vector<double> actions;
    auto env = std::make_unique<Direction>(1);
    env->log = &actions;
    sac.exploring(std::move(env), settings);
    // observation and z stay within an episode, so the mean does
    EXPECT_EQ(actions[0] == actions[1], !noise);
    EXPECT_NE(actions[0], actions[10]) << "each episode has a z of its own";
  }
}

TEST(Adapt, ExploresOnThePriorAloneOnDemand) {
  const Untrained sac;
  ContextSettings settings = smallSettings().context;
  std::vector<std::vector<double>> actions(2);
  for (const bool prior : {false, true}) {
    settings.exploration_prior = prior;
    auto env = std::make_unique<Direction>(1);
    env->log = &actions[prior ? 1 : 0];
    sac.exploring(std::move(env), settings);
  }
  EXPECT_EQ(actions[0][0], actions[1][0]) << "the first episode knows nothing else";
  EXPECT_NE(actions[0][10], actions[1][10]);

  // starts and z follow from the generator alone
  Rng rng(0, 0, Stream::kEvaluate);
  for (std::size_t episode = 0; episode < 3; ++episode) {
    const auto first = static_cast<float>(rng.normal());
    const std::vector<float> z = {first, static_cast<float>(rng.normal())};
    const auto start = static_cast<float>(rng.uniform());
    GaussianActor actor(sac.networks.actor(), z, 1, GaussianActor::By::kMean,
                        sac.parameters.data());
    double action = 0;
    actor.look(&start, {0});
    actor.act(0, rng, &action);
    EXPECT_EQ(actions[1][10 * episode], action);
  }
}

TEST(Adapt, CountsTheRewardThatMatters) {
  const Untrained sac;
  auto dense = std::make_unique<Direction>(1), sparse = std::make_unique<Direction>(1);
  sparse->sparse = true;
  const ContextSettings settings = smallSettings().context;
  EXPECT_NE(sac.exploring(std::move(dense), settings).back(),
            sac.exploring(std::move(sparse), settings).back());
}

TEST(Adapt, RefusesNetworksWithoutAnEncoder) {
  SacSettings settings = smallSettings();
  settings.task_encoding = "none";
  const SacNetworks networks(Direction(1).spec(), settings, 0);
  const AlignedFloats parameters(networks.size());
  EXPECT_EQ(test::errorOf([&] { LatentAdaptation(networks, settings.context, parameters.data()); }),
            "adapting to a task needs the context encoder: set task_encoding to inference.");
}

// undiscounted return of one episode by tanh(mean) with that z
double returnWith(const SacNetworks& networks, const float* parameters, double direction,
                  const std::vector<float>& z) {
  GaussianActor actor(networks.actor(), z, 1, GaussianActor::By::kMean, parameters);
  Rng rng(9, 0, Stream::kEvaluate);
  Evaluation evaluation(makeEnvs([&](int) { return std::make_unique<Direction>(direction); }, 1));
  return evaluation.run(actor, rng).mean;
}

TEST(Adapt, EncoderTellsTwoOppositeTasksApart) {
  // one set of parameters for both directions; only z can tell which
  const double directions[] = {1, -1};
  std::vector<std::unique_ptr<SacLearner>> learners;
  for (const double direction : directions) {
    learners.push_back(
        std::make_unique<SacLearner>(std::make_unique<Direction>(direction), smallSettings()));
  }
  const SacNetworks& networks = learners[0]->networks();
  AlignedFloats parameters(networks.size());
  Rng initial(0, 0, Stream::kInitialise);
  networks.initialise(parameters.data(), initial);
  ProximalAdamSettings adam;
  adam.learning_rate = 3e-3;
  ProximalAdam optimizer(parameters.data(), nullptr, parameters.size(), adam);
  std::vector<Rng> rngs = {Rng(0, 0, Stream::kSample), Rng(0, 1, Stream::kSample)};
  for (const auto& learner : learners) learner->resetTargets(parameters.data());
  for (int i = 0; i < 1500; ++i) {
    for (std::size_t task = 0; task < 2; ++task) {
      learners[task]->collect(parameters.data(), rngs[task]);
      optimizer.beginUpdate();
      learners[task]->update(parameters.data(), optimizer, rngs[task]);
    }
  }
  for (std::size_t task = 0; task < 2; ++task) {
    const std::vector<std::vector<float>> z =
        known(networks, smallSettings().context, parameters.data(),
              std::make_unique<Direction>(directions[task]), 3, Rng(4, task, Stream::kEvaluate));
    const auto returned = [&](const std::vector<float>& task_input) {
      return returnWith(networks, parameters.data(), directions[task], task_input);
    };
    EXPECT_GT(returned(z.back()), 7) << "of 10 in direction " << directions[task];
    const float* encoder = parameters.data() + networks.encoderOffset();
    const LatentPosterior own = learners[task]->context().posterior(encoder);
    EXPECT_GT(returned({own.mean.begin(), own.mean.end()}), 7);
    const LatentPosterior other = learners[1 - task]->context().posterior(encoder);
    EXPECT_LT(returned({other.mean.begin(), other.mean.end()}), -7);
    double distance = 0, deviation = 0;
    for (std::size_t j = 0; j < own.mean.size(); ++j) {
      distance += std::pow(own.mean[j] - other.mean[j], 2);
      deviation += own.variance[j] + other.variance[j];
    }
    EXPECT_GT(distance, 16 * deviation);
  }
}

}  // namespace
}  // namespace pmeta
