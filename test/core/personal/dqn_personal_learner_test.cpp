#include "pmeta_core/learn/dqn.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "../allocations.h"
#include "../memory_state.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta {
namespace {

std::unique_ptr<Env> makePole() { return std::make_unique<CartPole>(CartPoleTask{}); }

DqnSettings smallSettings() {
  DqnSettings settings;
  settings.hidden = {8, 6};
  settings.batch_size = 16;
  settings.buffer_size = 500;
  settings.num_envs = 3;
  settings.target_update_interval = 7;
  settings.evaluation_episodes = 4;
  return settings;
}

PersonalSettings pulled() {
  PersonalSettings settings;
  settings.learning_rate = 3e-3;
  settings.alpha = 1e-3;
  settings.lambda = 20;
  settings.eta = 1e-2;
  return settings;
}

PersonalLearner makeLearner(const DqnSettings& settings = smallSettings(),
                            const PersonalSettings& personal = pulled(),
                            std::int64_t total_updates = 1000) {
  const auto poles = [](int n) { return makeEnvs([](int) { return makePole(); }, n); };
  PersonalParts parts;
  parts.learner = std::make_unique<DqnLearner>(poles(settings.num_envs), settings, total_updates);
  parts.evaluation_envs = poles(settings.evaluation_episodes);
  return PersonalLearner(std::move(parts), personal);
}

const DqnLearner& dqn(const PersonalLearner& learner) {
  return dynamic_cast<const DqnLearner&>(learner.learner());
}

void run(PersonalLearner& learner, int updates, Rng& rng) {
  for (int r = 0; r < updates; ++r) learner.update(rng);
}

TEST(DqnPersonalLearner, LayoutIsTheNetworks) {
  EXPECT_EQ(makeLearner().layout().text(),
            "float32\nq.layer0.weight 8 4\nq.layer0.bias 8\nq.layer1.weight 6 8\nq.layer1.bias 6\n"
            "q.layer2.weight 2 6\nq.layer2.bias 2\n");
}

TEST(DqnPersonalLearner, BeginsAtANetworkOfTheSeed) {
  const auto learner = makeLearner();
  const Model model = learner.initialModel(3);
  EXPECT_TRUE(model == makeLearner().initialModel(3));
  EXPECT_FALSE(model == learner.initialModel(4));
  EXPECT_TRUE(model.present.empty());
  for (std::size_t k = 0; k < 32; ++k) EXPECT_LT(std::abs(model.floats()[k]), 0.5f);
}

// the equations in double precision, around a learner of their own
struct Reference : Optimizer<float> {
  Reference(const Model& meta, const PersonalSettings& s) : settings(s) {
    phi.assign(meta.floats().begin(), meta.floats().end());
    omega = phi;
    rounded = meta.floats();
    m.resize(phi.size());
    v.resize(phi.size());
  }
  void reset(const Model& meta) {
    phi.assign(meta.floats().begin(), meta.floats().end());
    omega = phi;
    rounded = meta.floats();
  }
  void move(std::size_t offset, const float* gradient, std::size_t n, float*, double) override {
    ++t;
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t j = offset + k;
      m[j] = 0.9 * m[j] + 0.1 * gradient[k];
      v[j] = 0.999 * v[j] + 0.001 * gradient[k] * gradient[k];
      const double m_hat = m[j] / (1 - std::pow(0.9, t));
      const double v_hat = v[j] / (1 - std::pow(0.999, t));
      phi[j] -= settings.learning_rate * m_hat / (std::sqrt(v_hat) + 1e-8);
      phi[j] -= settings.alpha * settings.lambda * (phi[j] - omega[j]);
      omega[j] += settings.eta * settings.lambda * (phi[j] - omega[j]);
      rounded[j] = static_cast<float>(phi[j]);
    }
  }
  PersonalSettings settings;
  std::vector<double> phi, omega, m, v;
  std::vector<float> rounded;
  int t = 0;
};

TEST(DqnPersonalLearner, RoundsFollowTheEquations) {
  for (const bool keep : {false, true}) {
    const DqnSettings settings = smallSettings();
    auto learner = makeLearner(settings);
    std::vector<std::unique_ptr<Env>> envs;
    for (int i = 0; i < settings.num_envs; ++i) envs.push_back(makePole());
    DqnLearner plain(std::move(envs), settings, 1000);
    Reference reference(learner.initialModel(1), pulled());
    plain.resetTargets(reference.rounded.data());

    for (int round = 1; round <= 3; ++round) {
      // a round resets parameters; moments, targets, replay and environments go on
      const Model meta = learner.initialModel(static_cast<std::uint64_t>(round));
      learner.beginRound(meta, keep);
      if (round == 1 || !keep) reference.reset(meta);
      reference.omega.assign(meta.floats().begin(), meta.floats().end());
      Rng rng(5, 0, Stream::kSample, round), same = rng;
      for (int r = 0; r < 10; ++r) {
        const UpdateStats stats = learner.update(rng);
        EXPECT_EQ(stats.env_steps, plain.collect(reference.rounded.data(), same));
        EXPECT_NEAR(stats.loss, plain.update(reference.rounded.data(), reference, same),
                    1e-3 * stats.loss);
        EXPECT_EQ(stats.updates, 1);
        for (std::size_t k = 0; k < reference.phi.size(); ++k) {
          ASSERT_NEAR(learner.personal().floats()[k], reference.phi[k], 2e-5);
          ASSERT_NEAR(learner.auxiliary().floats()[k], reference.omega[k], 2e-5);
        }
      }
    }
    EXPECT_EQ(dqn(learner).updates(), 30);
  }
}

TEST(DqnPersonalLearner, RoundResetsParametersAndNothingElse) {
  auto learner = makeLearner();
  const Model meta = learner.initialModel(2);
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(learner.initialModel(1), false);
  EXPECT_TRUE(std::equal(dqn(learner).targets().begin(), dqn(learner).targets().end(),
                         learner.personal().floats().begin()))
      << "the first target is the first meta-policy";
  run(learner, 10, rng);
  const AlignedFloats first = learner.adam().firstMoment();
  const AlignedFloats second = learner.adam().secondMoment();
  const AlignedFloats targets = dqn(learner).targets();
  const std::vector<float> replay = dqn(learner).replay().buffer().values();
  const std::vector<float> kept = learner.personal().floats();
  EXPECT_NE(kept, meta.floats());

  learner.beginRound(learner.initialModel(3), true);
  EXPECT_EQ(learner.personal().floats(), kept);
  EXPECT_EQ(learner.auxiliary().floats(), learner.initialModel(3).floats());
  learner.beginRound(meta, false);
  EXPECT_EQ(learner.personal().floats(), meta.floats());
  EXPECT_EQ(learner.auxiliary().floats(), meta.floats());
  EXPECT_EQ(test::stateOf(learner.adam()).get<std::int64_t>("updates").at(0), 10);
  EXPECT_EQ(learner.adam().firstMoment(), first);
  EXPECT_EQ(learner.adam().secondMoment(), second);
  EXPECT_EQ(dqn(learner).targets(), targets);
  EXPECT_EQ(dqn(learner).replay().buffer().values(), replay);
  EXPECT_EQ(dqn(learner).updates(), 10);
}

TEST(DqnPersonalLearner, AuxiliaryStaysTheMetaPolicyWithoutPull) {
  PersonalSettings optimizer = pulled();
  optimizer.lambda = 0;
  auto learner = makeLearner(smallSettings(), optimizer);
  const Model meta = learner.initialModel(1);
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(meta, false);
  run(learner, 5, rng);
  EXPECT_EQ(learner.auxiliary().floats(), meta.floats());
  EXPECT_NE(learner.personal().floats(), meta.floats());
}

TEST(DqnPersonalLearner, OneSeedOneResultWhateverIsEvaluated) {
  auto a = makeLearner(), b = makeLearner(), other = makeLearner();
  const Model meta = a.initialModel(1);
  for (int round = 1; round <= 3; ++round) {
    for (PersonalLearner* learner : {&a, &b, &other}) {
      learner->beginRound(meta, false);
      Rng rng(learner == &other ? 8 : 7, 0, Stream::kSample, round);
      run(*learner, 20, rng);
      if (learner == &b) continue;
      Rng evaluation(7, 0, Stream::kEvaluate);
      learner->evaluate(learner->personal(), evaluation);
      learner->record(meta, evaluation);
    }
  }
  EXPECT_EQ(a.personal().checksum(), b.personal().checksum());
  EXPECT_EQ(a.auxiliary().checksum(), b.auxiliary().checksum());
  EXPECT_NE(a.personal().checksum(), other.personal().checksum());
}

TEST(DqnPersonalLearner, EvaluationDependsOnPolicyAndSeedOnly) {
  auto learner = makeLearner();
  const Model policy = learner.initialModel(1);
  const auto evaluate = [&](std::uint64_t seed) {
    Rng rng(seed, 0, Stream::kEvaluate);
    return learner.evaluate(policy, rng);
  };
  const ReturnStats before = evaluate(1);
  learner.beginRound(learner.initialModel(2), false);
  Rng rng(1, 0, Stream::kSample);
  run(learner, 20, rng);
  EXPECT_EQ(evaluate(1).mean, before.mean);
  EXPECT_EQ(evaluate(1).std, before.std);
  EXPECT_EQ(before.episodes, 4);
}

TEST(DqnPersonalLearner, RecordsAGreedyEpisode) {
  auto learner = makeLearner();
  const Model policy = learner.initialModel(1);
  Rng rng(1, 0, Stream::kEvaluate);
  const Episode e = learner.record(policy, rng);
  ASSERT_EQ(e.observation_size, 4);
  ASSERT_EQ(e.observations.size(), 4 * (e.rewards.size() + 1));
  EXPECT_NE(e.terminated, e.truncated);
  const Mlp& network = dqn(learner).network();
  MlpWorkspace workspace(network, 1);
  for (std::size_t t = 0; t < e.actions.size(); ++t) {
    const std::vector<float> observation(
        e.observations.begin() + static_cast<std::ptrdiff_t>(4 * t),
        e.observations.begin() + static_cast<std::ptrdiff_t>(4 * t + 4));
    const float* q = network.forward(policy.floats().data(), observation.data(), 1, workspace);
    EXPECT_EQ(e.actions[t], q[1] > q[0] ? 1 : 0);
  }
  EXPECT_TRUE(e.state_values.empty());
}

TEST(DqnPersonalLearner, UpdatesAllocateNothing) {
  for (const double alpha : {0.0, 0.6}) {
    DqnSettings settings = smallSettings();
    settings.priority_alpha = alpha;
    settings.double_q = true;
    settings.averaged_targets = 2;
    auto learner = makeLearner(settings);
    Rng rng(1, 0, Stream::kSample);
    learner.beginRound(learner.initialModel(1), false);
    run(learner, 1, rng);
    const std::size_t before = test::allocations();
    run(learner, 300, rng);  // fills the replay and turns it over
    EXPECT_EQ(test::allocations() - before, 0u);
    EXPECT_EQ(dqn(learner).replay().size(), 500u);
  }
}

struct Variant {
  const char* name;
  bool double_q, dueling, huber;
  int averaged_targets;
};

class DqnSolves : public ::testing::TestWithParam<Variant> {};

TEST_P(DqnSolves, CartPole) {
  DqnSettings settings;
  settings.hidden = {32, 32};
  settings.double_q = GetParam().double_q;
  settings.dueling = GetParam().dueling;
  settings.huber = GetParam().huber;
  settings.averaged_targets = GetParam().averaged_targets;
  settings.target_update_interval = 200;
  PersonalSettings plain = pulled();
  plain.lambda = 0;
  PersonalLearner learner = makeLearner(settings, plain, 4000);
  learner.beginRound(learner.initialModel(0), false);
  Rng rng(0, 0, Stream::kSample), evaluation(0, 0, Stream::kEvaluate);
  EXPECT_LT(learner.evaluate(learner.personal(), evaluation).mean, 60);
  // returns swing while it learns, and rounding differs between machines: look more than once
  double best = 0;
  for (int i = 0; i < 8 && best < 150; ++i) {
    run(learner, 500, rng);
    best = std::max(best, learner.evaluate(learner.personal(), evaluation).mean);
  }
  EXPECT_GT(best, 150);
}

INSTANTIATE_TEST_SUITE_P(Variants, DqnSolves,
                         ::testing::Values(Variant{"Plain", false, false, false, 1},
                                           Variant{"DoubleDuelingHuber", true, true, true, 1},
                                           Variant{"Averaged", false, false, false, 3}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace pmeta
