// What MetaCURE is made of: kept trials, beliefs along them, and what a step tells of the task.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "baselines/opposite_goals.h"
#include "baselines/oracle.h"
#include "memory_state.h"
#include "pmeta_core/baselines/information_gain.h"
#include "pmeta_core/baselines/metacure_explorer.h"
#include "pmeta_core/learn/sac_update.h"
#include "support.h"

namespace pmeta {
namespace {

MetaCureSettings smallSettings() {
  MetaCureSettings settings;
  settings.sac.hidden = {12, 8};
  settings.sac.portable = true;
  settings.recurrent_units = 6;
  settings.latent_size = 2;
  settings.meta_batch = 3;
  settings.task_batch = 4;
  return settings;
}

EnvSpec pointSpec() { return test::DensePoint({1, 0}).spec(); }

void addSteps(TrialStore& store, int steps, float first) {
  for (int t = 0; t < steps; ++t) {
    const float at[] = {first + static_cast<float>(t), 0}, next[] = {at[0] + 0.5f, 1};
    const float action[] = {0.25f, -at[0]};
    store.add({at, action, -at[0], at[0] / 8, next});
  }
  store.endTrial();
}

TEST(TrialStore, KeepsTheMostRecentTrials) {
  TrialStore store(2, 4, 2, 2);
  for (int k = 0; k < 3; ++k) {
    addSteps(store, 2 + k, static_cast<float>(10 * k));
    addSteps(store, 0, 0);  // broke down at once
  }
  ASSERT_EQ(store.size(), 2u);
  const StoredTrial newest = store[0], older = store[1];
  EXPECT_EQ(newest.steps(), 4u);
  EXPECT_EQ(older.steps(), 3u);
  EXPECT_EQ(newest[3].observation[0], 23);
  EXPECT_EQ(newest[3].action[1], -23);
  EXPECT_EQ(newest[3].reward, -23);
  EXPECT_EQ(newest[3].evaluated_reward, 23.0f / 8);
  EXPECT_EQ(newest.place(3)[0], 23) << "not what step 2 led to";
  EXPECT_EQ(newest.place(4)[0], 23.5f);
}

TEST(TrialStore, GoesOnFromItsState) {
  TrialStore store(2, 4, 2, 2), other(2, 4, 2, 2);
  for (const int steps : {1, 4, 2}) addSteps(store, steps, 1);
  test::MemoryState state = test::stateOf(store);
  test::load(other, state);
  addSteps(store, 3, 7);
  addSteps(other, 3, 7);
  EXPECT_EQ(test::stateOf(other), test::stateOf(store));

  state.set<std::int64_t>("steps", {2, 5});
  EXPECT_NE(test::errorOf([&] { test::load(other, state); }).find("a trial of 5 steps"),
            std::string::npos);
  state.set<std::int64_t>("steps", {2, 4});
  state.set<std::int64_t>("next", {2});
  EXPECT_NE(test::errorOf([&] { test::load(other, state); }).find("next"), std::string::npos);
}

/// Leaves all parameters where they are.
class Still : public Optimizer<float> {
  void move(std::size_t, const float*, std::size_t, float*, double) override {}
};

// of trials of different lengths: the critics' loss of steps on z from beliefs, and the KL
class CriticLoss {
 public:
  explicit CriticLoss(const MetaCureSettings& settings)
      : networks_(pointSpec(), settings),
        latent_(networks_.encoder().latentSize()),
        theta_(networks_.size()),
        store_(3, 5, 2, 2),
        beliefs_(networks_.encoder(), 3, 5),
        update_(networks_.exploiter(), exploiterSettings(settings), {}) {
    Rng rng(2, 0, Stream::kInitialise);
    networks_.initialise(theta_.data(), rng);
    for (const int steps : {2, 5, 3}) addSteps(store_, steps, static_cast<float>(0.1 * steps));
    Rng drawn(3, 0, Stream::kMeasure);
    for (int i = 0; i < 24; ++i) noise_.push_back(static_cast<float>(drawn.normal()));
  }

  float* encoder() { return &theta_[networks_.encoderOffset()]; }
  std::size_t size() const { return networks_.encoder().size(); }

  // and its gradient by the encoder
  double at(float* gradient) {
    beliefs_.infer(encoder(), {store_[0], store_[1], store_[2]});
    const float action[] = {0.5f, -0.5f}, place[] = {0.3f, -0.2f};
    std::vector<float> z(latent_);
    for (std::size_t row = 0; row < 12; ++row) {
      const float* belief = beliefAt(row);
      for (std::size_t i = 0; i < latent_; ++i) {
        z[i] = belief[i] + std::sqrt(belief[latent_ + i]) * noise_[row * latent_ + i];
      }
      // no next state: its value is no target to be differentiated
      update_.put(row, {place, action, 0.3f, 0, place}, z.data(), z.data());
    }
    Still still;
    Rng rng(4, 0, Stream::kMeasure);
    double loss = 2 * update_.apply(theta_.data(), still, rng).critic;
    for (std::size_t row = 0; row < 12; ++row) {
      loss += 0.1 * beliefKl(beliefAt(row), latent_);
      addBeliefGradient(beliefAt(row), latent_, &noise_[row * latent_],
                        &update_.taskInputGradient()[row * latent_], 0.1f,
                        beliefs_.gradientAt(row / 4, row % 3));
    }
    beliefs_.backward(encoder(), gradient);
    return loss;
  }

 private:
  const float* beliefAt(std::size_t row) const { return beliefs_.at(row / 4, row % 3); }

  MetaCureNetworks networks_;
  std::size_t latent_;
  std::vector<float> theta_;
  TrialStore store_;
  TrialBeliefs beliefs_;
  SacUpdate update_;
  std::vector<float> noise_;
};

TEST(TrialBeliefs, GradientThroughTimeAndZAgreesWithCentralDifferences) {
  CriticLoss loss(smallSettings());
  std::vector<float> gradient(loss.size()), unused(loss.size());
  loss.at(gradient.data());
  double largest = 0;
  for (std::size_t k = 0; k < gradient.size(); ++k) {
    float& theta = loss.encoder()[k];
    const float at = theta, h = 4e-3f;
    theta = at + h;
    const double high = theta, above = loss.at(unused.data());
    theta = at - h;
    const double low = theta, below = loss.at(unused.data());
    theta = at;
    EXPECT_NEAR(gradient[k], (above - below) / (high - low), 1e-3) << k;
    largest = std::max(largest, std::abs(static_cast<double>(gradient[k])));
  }
  EXPECT_GT(largest, 0.1);
}

TEST(TrialBeliefs, KlAgreesWithTheOracle) {
  const auto json = test::loadOracle("metacure_oracle.json")["belief"];
  std::vector<double> belief = json["mean"], variance = json["variance"];
  belief.insert(belief.end(), variance.begin(), variance.end());
  EXPECT_NEAR(beliefKl(belief.data(), 2), json["kl_to_prior"].get<double>(), 1e-12);
}

// keeps what an actor sees as a trial
class Recorded : public Actor {
 public:
  Recorded(Actor& actor, TrialStore& store) : actor_(actor), store_(store) {}
  void begin(std::size_t env, Rng& rng) override { actor_.begin(env, rng); }
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    actor_.look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return actor_.act(row, rng, action);
  }
  void observe(const Experience& e) override {
    const float action[] = {static_cast<float>(e.action[0]), static_cast<float>(e.action[1])};
    store_.add({e.observation, action, static_cast<float>(e.step.reward),
                static_cast<float>(e.step.evaluatedReward()), e.next_observation});
    actor_.observe(e);
  }

 private:
  Actor& actor_;
  TrialStore& store_;
};

TEST(MetaCureExplorer, BelievesWhatItIsTrainedOn) {
  const MetaCureNetworks networks(pointSpec(), smallSettings());
  std::vector<float> theta(networks.size());
  Rng rng(2, 0, Stream::kInitialise);
  networks.initialise(theta.data(), rng);
  MetaCureExplorer explorer(networks, theta.data(), GaussianActor::By::kSample);
  EXPECT_EQ(explorer.belief(), (std::vector<float>{0, 0, 1, 1})) << "the prior";

  TrialStore store(1, 40, 2, 2);
  Recorded recorded(explorer, store);
  const test::OppositeGoals family;
  Evaluation evaluation(makeEnvs([&](int) { return family.make(0); }, 1));
  for (int episode = 0; episode < 2; ++episode) evaluation.explore(recorded, rng);
  store.endTrial();
  const StoredTrial trial = store[0];
  ASSERT_EQ(trial.steps(), 40u);
  EXPECT_EQ(trial.place(20)[0], 0) << "the second episode's start";
  EXPECT_NE(trial[19].next_observation[0], 0);

  TrialBeliefs beliefs(networks.encoder(), 1, 40);
  beliefs.infer(&theta[networks.encoderOffset()], {trial});
  const std::vector<float> last = explorer.belief();
  for (std::size_t i = 0; i < last.size(); ++i) EXPECT_NEAR(last[i], beliefs.at(0, 40)[i], 1e-5);
  EXPECT_NE(last[0], beliefs.at(0, 39)[0]);
  explorer.forget();
  EXPECT_EQ(explorer.belief()[0], 0);
}

TEST(InformationGain, AgreesWithTheOracle) {
  const auto json = test::loadOracle("metacure_oracle.json");
  for (const bool dynamics : {false, true}) {
    const std::string suffix = dynamics ? "_with_dynamics" : "";
    for (std::size_t k = 0; k < 3; ++k) {
      const auto row = [&](const std::string& which) {
        std::vector<double> all = {json["reward" + which][k]};
        if (dynamics) {
          for (const double value : json["next" + which][k]) all.push_back(value);
        }
        return all;
      };
      const std::vector<double> seen = row(""), belief = row("_by_belief"), task = row("_by_task");
      const double gain = predictionError(belief.data(), seen.data(), seen.size()) -
                          predictionError(task.data(), seen.data(), seen.size());
      EXPECT_NEAR(gain, json["intrinsic_reward" + suffix][k].get<double>(), 1e-12);
      EXPECT_NEAR(seen[0] + json["weight"].get<double>() * gain,
                  json["explorer_reward" + suffix][k].get<double>(), 1e-12);
    }
  }
}

// two tasks whose rewards, or next observations, are opposite: of steps whose belief says which
// it is there is nothing to be learnt
TEST(InformationGain, IsWhatTheBeliefDoesNotKnow) {
  for (const bool dynamics : {false, true}) {
    MetaCureSettings settings = smallSettings();
    settings.predicts_next = dynamics;
    settings.learning_rate = 1e-2;
    InformationGain gain(pointSpec(), 2, settings);
    Rng rng(1, 0, Stream::kInitialise);
    gain.initialise(rng);
    InformationGain::Losses losses;
    for (int k = 0; k < 400; ++k) {
      for (std::size_t row = 0; row < 12; ++row) {
        const std::size_t task = row % 2;
        const float sign = task == 0 ? 1 : -1;
        const float at[] = {static_cast<float>(rng.normal()), 0}, action[] = {0.5f, 0};
        const float next[] = {dynamics ? sign : 0, dynamics ? sign : 0};
        const float knows = row < 6 ? sign : 0;
        const float belief[] = {knows, 0, 1, 1};
        gain.put(row, {at, action, dynamics ? 0 : sign, 0.9f, next}, belief, task);
      }
      losses = gain.learn();
    }
    EXPECT_NEAR(losses.by_belief, 0.5, 0.1);
    EXPECT_NEAR(losses.by_task, 0, 0.01);
    const std::vector<float>& gains = gain.gains();
    for (std::size_t row = 0; row < 12; ++row) {
      EXPECT_NEAR(gains[row], row < 6 ? 0 : 1, 0.35) << row;
    }
  }
}

}  // namespace
}  // namespace pmeta
