#include "pmeta_core/baselines/rl2.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "baselines/opposite_goals.h"
#include "baselines/oracle.h"
#include "memory_state.h"
#include "pmeta_core/adapt/adapted_return.h"
#include "pmeta_core/baselines/rl2_actor.h"
#include "support.h"

namespace pmeta {
namespace {

Rl2Settings smallSettings() {
  Rl2Settings settings;
  settings.hidden = 8;
  settings.head = {6};
  settings.trials = 5;
  settings.episodes = 2;
  settings.portable = true;
  return settings;
}

EnvSpec specOf(int observation_size, int action_size) {
  EnvSpec spec;
  spec.observation_size = observation_size;
  spec.action_size = action_size;
  return spec;
}

// the oracle's trials and what PPO makes of them
struct Oracle {
  Oracle() {
    settings.hidden = json["hidden"];
    settings.head = {};
    settings.ppo = {json["clip"], json["value_coefficient"], false, false,
                    json["entropy_coefficient"]};
    for (std::size_t k = 0; k < 2; ++k) {
      Trial trial;
      trial.steps = json["steps"];
      for (const auto& row : json["x"][k]) append(trial.inputs, row);
      for (const auto& row : json["actions_taken"][k]) append(trial.actions, row);
      trials.push_back(trial);
      TrialTargets target;
      append(target.log_densities, json["old_logp"][k]);
      append(target.advantages, json["advantages"][k]);
      append(target.returns, json["returns"][k]);
      target.values.resize(trial.steps);
      targets.push_back(target);
    }
  }
  static void append(AlignedFloats& values, const nlohmann::json& row) {
    for (const float value : row) values.push_back(value);
  }

  nlohmann::json json = test::loadOracle("rl2_oracle.json");
  Rl2Settings settings;
  std::vector<Trial> trials;
  std::vector<TrialTargets> targets;
};

TEST(Rl2, LossAndGradientThroughTimeAgreeWithTheOracle) {
  const Oracle oracle;
  const Rl2Networks networks(specOf(3, 2), oracle.settings);
  Rl2Update update(networks, oracle.settings.ppo, 2, 6);
  const auto theta = oracle.json["theta"].get<std::vector<float>>();
  ASSERT_EQ(theta.size(), networks.size());
  std::vector<float> gradient(networks.size());
  const PpoLoss loss =
      update.gradient(theta.data(), oracle.trials, oracle.targets, {0, 1}, gradient.data());
  EXPECT_NEAR(loss.total(oracle.settings.ppo), oracle.json["loss"].get<double>(), 1e-6);
  for (std::size_t k = 0; k < gradient.size(); ++k) {
    EXPECT_NEAR(gradient[k], oracle.json["gradient"][k].get<double>(), 1e-6) << k;
  }
}

TEST(Rl2, LogDensitiesAgreeWithTheOracle) {
  Oracle oracle;
  const Rl2Networks networks(specOf(3, 2), oracle.settings);
  Rl2Update update(networks, oracle.settings.ppo, 2, 6);
  const auto theta = oracle.json["theta_old"].get<std::vector<float>>();
  update.evaluate(theta.data(), oracle.trials, {1, 0}, oracle.targets);
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t t = 0; t < 6; ++t) {
      EXPECT_NEAR(oracle.targets[k].log_densities[t], oracle.json["old_logp"][k][t].get<double>(),
                  2e-6);
    }
  }
}

// trials of different lengths, one of them without a step, and their targets
struct Uneven {
  Uneven(const Rl2Networks& networks, Rl2Update& update, const float* parameters) {
    Rng rng(3, 0, Stream::kMeasure);
    const auto fill = [&](AlignedFloats& values, std::size_t n) {
      for (std::size_t k = 0; k < n; ++k) values.push_back(static_cast<float>(rng.normal()));
    };
    for (const std::size_t steps : {2, 5, 0, 3}) {
      Trial trial;
      trial.steps = steps;
      fill(trial.inputs, steps * networks.gru().inputs());
      fill(trial.actions, steps * networks.actionSize());
      TrialTargets target;
      fill(target.advantages, steps);
      fill(target.returns, steps);
      trials.push_back(trial);
      targets.push_back(target);
    }
    update.evaluate(parameters, trials, {0, 1, 2, 3}, targets);
    // away from where the ratio is 1
    for (TrialTargets& target : targets) {
      for (float& l : target.log_densities) l += static_cast<float>(0.2 * rng.normal());
    }
  }
  std::vector<Trial> trials;
  std::vector<TrialTargets> targets;
};

TEST(Rl2, GradientsOfUnevenTrialsAgreeWithCentralDifferences) {
  Rl2Settings settings = smallSettings();
  settings.ppo.clip = 10;  // smooth
  const Rl2Networks networks(specOf(3, 2), settings);
  std::vector<float> theta(networks.size()), gradient(networks.size()), unused(networks.size());
  Rng rng(2, 0, Stream::kInitialise);
  networks.initialise(theta.data(), rng);
  Rl2Update update(networks, settings.ppo, 4, 5);
  const Uneven uneven(networks, update, theta.data());
  const auto loss = [&](std::vector<float>& into) {
    return update.gradient(theta.data(), uneven.trials, uneven.targets, {0, 1, 2, 3}, into.data())
        .total(settings.ppo);
  };
  loss(gradient);
  for (std::size_t k = 0; k < theta.size(); ++k) {
    const float at = theta[k], h = 2e-3f;
    theta[k] = at + h;
    const double high = theta[k], above = loss(unused);
    theta[k] = at - h;
    const double low = theta[k], below = loss(unused);
    theta[k] = at;
    EXPECT_NEAR(gradient[k], (above - below) / (high - low), 2e-4) << k;
  }
}

TEST(Rl2, ALossIsThatOfItsTrialsApart) {
  const Rl2Settings settings = smallSettings();
  const Rl2Networks networks(specOf(3, 2), settings);
  std::vector<float> theta(networks.size()), all(networks.size()), sum(networks.size());
  Rng rng(2, 0, Stream::kInitialise);
  networks.initialise(theta.data(), rng);
  Rl2Update update(networks, settings.ppo, 4, 5);
  const Uneven uneven(networks, update, theta.data());
  update.gradient(theta.data(), uneven.trials, uneven.targets, {0, 1, 2, 3}, all.data());
  for (const std::size_t k : {0, 1, 3}) {
    std::vector<float> one(networks.size());
    update.gradient(theta.data(), uneven.trials, uneven.targets, {k}, one.data());
    const auto share = static_cast<float>(uneven.trials[k].steps) / 10;
    for (std::size_t i = 0; i < one.size(); ++i) sum[i] += share * one[i];
  }
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_NEAR(sum[i], all[i], 1e-6) << i;
}

TEST(Rl2, InputsKeepTheLastStepFromOneEpisodeToTheNext) {
  const MetaTasks tasks = test::oppositeGoals();
  const Rl2Networks networks(tasks.family->make(0)->spec(), smallSettings());
  std::vector<float> theta(networks.size());
  Rng rng(2, 0, Stream::kInitialise);
  networks.initialise(theta.data(), rng);
  TrialSampler sampler(tasks, networks, 2, 3);
  std::vector<Trial> trials(3);
  IterationStats stats;
  sampler.play(theta.data(), 7, 1, trials, stats);
  // 3 trials from the 3rd on: tasks 1, 0, 1
  EXPECT_EQ(stats.env_steps, (std::vector<std::int64_t>{40, 80}));
  for (const Trial& trial : trials) {
    ASSERT_EQ(trial.steps, 40u);
    const std::size_t n = networks.gru().inputs();
    for (std::size_t k = 0; k < n; ++k) EXPECT_EQ(trial.inputs[k], 0);
    for (std::size_t t = 1; t < 40; ++t) {
      const float* x = &trial.inputs[t * n];
      EXPECT_EQ(x[2], trial.actions[2 * (t - 1)]);
      EXPECT_EQ(x[3], trial.actions[2 * (t - 1) + 1]);
      EXPECT_EQ(x[4], trial.rewards[t - 1]);
      EXPECT_EQ(x[5], t == 20 ? 1 : 0);
      if (t == 20) EXPECT_EQ(x[0], 0) << "the observation is the next start's";
    }
    const auto begin = trial.rewards.begin();
    EXPECT_NEAR(trial.first_return, std::accumulate(begin, begin + 20, 0.0), 1e-5);
    EXPECT_NEAR(trial.last_return, std::accumulate(begin + 20, begin + 40, 0.0), 1e-5);
  }
}

TEST(Rl2, ItActsAsItIsTrained) {
  // the density of what was drawn has the mean that the unroll gives
  const MetaTasks tasks = test::oppositeGoals();
  Rl2Settings settings = smallSettings();
  settings.initial_log_std = -10;
  const Rl2Networks networks(tasks.family->make(0)->spec(), settings);
  std::vector<float> theta(networks.size());
  Rng rng(2, 0, Stream::kInitialise);
  networks.initialise(theta.data(), rng);
  TrialSampler sampler(tasks, networks, 2, 2);
  std::vector<Trial> trials(2);
  std::vector<TrialTargets> targets(2);
  IterationStats stats;
  sampler.play(theta.data(), 7, 0, trials, stats);
  Rl2Update(networks, settings.ppo, 2, 40).evaluate(theta.data(), trials, {0, 1}, targets);
  double sum = 0;
  for (const float l : targets[0].log_densities) sum += l / 40;
  EXPECT_NEAR(sum, 2 * (10 - 0.5 - 0.5 * std::log(2 * M_PI)), 1);
}

TEST(Rl2, AnUntrainedPolicyTellsNoTaskFromTheOther) {
  Rl2 rl2(test::oppositeGoals(), smallSettings());
  rl2.setModel(test::initialModel(rl2, 1));
  const test::GoalReturns goals = test::evaluateOnGoals(rl2, {1, 2});
  EXPECT_EQ(goals.episodes, (std::vector<int>{0, 1, 2}));
  EXPECT_LT(goals.mean(0), -19.5);
}

TEST(Rl2, EachEvaluationEpisodeBeginsWithACopyOfWhatIsKnown) {
  Rl2 rl2(test::oppositeGoals(), smallSettings());
  rl2.setModel(test::initialModel(rl2, 1));
  const MetaTasks tasks = test::oppositeGoals();
  Evaluation evaluation(makeEnvs([&](int) { return tasks.family->make(0); }, 3));
  Rng rng(0, 0, Stream::kEvaluate);
  const auto adaptation = rl2.adapt(rl2.model(), 0);
  evaluation.explore(*adaptation, rng);
  const auto actor = adaptation->adapted(3);
  const ReturnStats first = evaluation.run(*actor, rng), again = evaluation.run(*actor, rng);
  EXPECT_EQ(first.mean, again.mean);
  EXPECT_NEAR(first.std, 0, 1e-5) << "alike in all environments";
  const test::GoalReturns alone = test::evaluateOnGoals(rl2, {1});
  EXPECT_NEAR(first.mean, alone.returns[1].first, 1e-5);
  EXPECT_NE(alone.returns[0].first, alone.returns[1].first);
}

TEST(Rl2, ResumedIsUninterrupted) {
  Rl2 whole(test::oppositeGoals(), smallSettings());
  whole.setModel(test::initialModel(whole, 1));
  for (std::uint64_t i = 0; i < 2; ++i) whole.iterate(5, i);
  Rl2 resumed(test::oppositeGoals(), smallSettings());
  resumed.setModel(whole.model());
  test::load(resumed, test::stateOf(whole));
  for (std::uint64_t i = 2; i < 4; ++i) {
    const IterationStats a = whole.iterate(5, i), b = resumed.iterate(5, i);
    EXPECT_EQ(a.env_steps, b.env_steps);
    EXPECT_EQ(a.updates, 8);
  }
  EXPECT_TRUE(whole.model() == resumed.model());
  EXPECT_TRUE(test::stateOf(whole) == test::stateOf(resumed));
}

TEST(Rl2, BadSettingsAreOneSentence) {
  const auto error = [](const std::string& name, const std::string& value) {
    return test::errorOf([&] {
      const auto kind = metaLearners().at("rl2").make();
      Settings settings;
      kind->bind(settings);
      settings.assign("rl2." + name + ":=" + value);
      kind->check(2);
    });
  };
  EXPECT_EQ(error("trials", "4"), "(no error)");
  EXPECT_NE(error("trials", "3").find("rl2.minibatches (4) must not be more than rl2.trials (3)"),
            std::string::npos);
  EXPECT_NE(error("exploration_episodes", "[2, 1]").find("ascending"), std::string::npos);
  EXPECT_NE(error("clip", "0").find("above 0"), std::string::npos);
  EXPECT_NE(error("gamma", "1.1").find("rl2.gamma"), std::string::npos);
  EXPECT_NE(error("initialisation", "zero").find("orthogonal, glorot"), std::string::npos);
}

TEST(Rl2, DiscreteActionsAreRefused) {
  EnvSpec spec = specOf(4, 1);
  spec.name = "cart_pole";
  spec.num_actions = 2;
  EXPECT_EQ(test::errorOf([&] { Rl2Networks(spec, Rl2Settings()); }),
            "environment 'cart_pole' has discrete actions: rl2 needs continuous ones.");
}

// return of a second episode whose policy has the hidden state of a trial's start again
double returnWithoutHiddenState(const Rl2& rl2, int task) {
  const MetaTasks tasks = test::oppositeGoals();
  Evaluation evaluation(makeEnvs([&](int) { return tasks.family->make(task); }, 1));
  Rng rng(0, 0, Stream::kEvaluate);
  const Rl2Networks& networks = static_cast<const Rl2Policies&>(rl2.policies()).networks();
  const float* parameters = rl2.model().floats().data();
  Rl2Adaptation adaptation(networks, parameters);
  evaluation.explore(adaptation, rng);
  TrialMemory memory = adaptation.memory();
  memory.hidden = TrialMemory(networks).hidden;
  Rl2Actor actor(networks, parameters, 1, memory);
  return evaluation.run(actor, rng).mean;
}

Rl2Settings goalSettings() {
  Rl2Settings settings;
  settings.hidden = 32;
  settings.head = {};
  settings.trials = 40;
  settings.episodes = 2;
  settings.learning_rate = 3e-3;
  settings.ppo.clip = 0.2;
  settings.epochs = 4;
  settings.initial_log_std = -0.5;
  settings.ppo.value_coefficient = 0.5;
  settings.ppo.clip_values = false;
  settings.ppo.entropy_coefficient = 0;
  return settings;
}

TEST(Rl2, LearnsToFindOutWhichOfTwoGoalsItIsSentTo) {
  Rl2 rl2(test::oppositeGoals(), goalSettings());
  rl2.setModel(test::initialModel(rl2, 1));
  // with seeds 1 to 8: -7.5 to -8.5 in the first episode, -4.9 to -5.6 in the second
  for (std::uint64_t i = 0; i < 100; ++i) rl2.iterate(1, i);
  const test::GoalReturns goals = test::evaluateOnGoals(rl2, {1});
  EXPECT_GT(goals.mean(1), -7);
  EXPECT_GT(goals.mean(1), goals.mean(0) + 1);
  EXPECT_LT((returnWithoutHiddenState(rl2, 0) + returnWithoutHiddenState(rl2, 1)) / 2,
            goals.mean(0) + 1);
}

TEST(Rl2, LearnsByALinearBaselineToo) {
  Rl2Settings settings = goalSettings();
  settings.baseline = "linear";
  settings.gae_lambda = 1;
  settings.initialisation = "glorot";
  Rl2 rl2(test::oppositeGoals(), settings);
  const Model initial = test::initialModel(rl2, 1);
  rl2.setModel(initial);
  for (std::uint64_t i = 0; i < 100; ++i) rl2.iterate(1, i);
  const test::GoalReturns goals = test::evaluateOnGoals(rl2, {1});
  EXPECT_GT(goals.mean(1), -9);
  const Rl2Networks& networks = static_cast<const Rl2Policies&>(rl2.policies()).networks();
  for (std::size_t k = networks.valueOffset(); k < networks.logStdOffset(); ++k) {
    ASSERT_EQ(rl2.model().floats()[k], initial.floats()[k]) << "the critic learns nothing";
  }
}

TEST(Rl2, ThreadsChangeNothing) {
  std::vector<Model> models;
  for (const int threads : {1, 3}) {
    Rl2 rl2(test::oppositeGoals(0, threads), smallSettings());
    rl2.setModel(test::initialModel(rl2, 1));
    for (std::uint64_t i = 0; i < 3; ++i) rl2.iterate(1, i);
    models.push_back(rl2.model());
  }
  EXPECT_TRUE(models[0] == models[1]);
}

}  // namespace
}  // namespace pmeta
