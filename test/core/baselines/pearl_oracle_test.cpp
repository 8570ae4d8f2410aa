// What an independent float64 implementation of PEARL's inference and losses gives.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "baselines/oracle.h"
#include "pmeta_core/act/gaussian_policy.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_losses.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

using test::flat;
using Json = nlohmann::json;

constexpr double kFloat = 1e-5;  // what float32 is asked for, relatively

std::vector<float> floats(const Json& list) {
  const std::vector<double> values = flat(list);
  return {values.begin(), values.end()};
}

void expectNear(const std::vector<float>& values, const std::vector<double>& expected) {
  ASSERT_EQ(values.size(), expected.size());
  EXPECT_LT(test::relativeError(values, expected), kFloat);
}

// an encoder without hidden layers that gives its rows of four numbers as the heads
class PearlInference : public ::testing::Test {
 protected:
  PearlInference() : encoder_(2, 1, settings()), workspace_(encoder_, 4) {
    parameters_.resize(encoder_.network().size());
    for (std::size_t j = 0; j < 4; ++j) parameters_[5 * j] = 1;
  }
  static ContextSettings settings() {
    ContextSettings settings;
    settings.hidden = {};
    settings.latent_size = 2;
    return settings;
  }
  void infer(std::size_t task) {
    rows_.clear();
    const std::vector<float> mu = floats(oracle_["mu"][task]);
    const std::vector<float> raw = floats(oracle_["raw_variance"][task]);
    for (std::size_t i = 0; i < 4; ++i) {
      rows_.insert(rows_.end(), {mu[2 * i], mu[2 * i + 1], raw[2 * i], raw[2 * i + 1]});
    }
    encoder_.infer(parameters_.data(), rows_.data(), 4, workspace_, posterior_);
  }

  const Json oracle_ = test::loadOracle("pearl_oracle.json")["pearl"];
  ContextEncoder encoder_;
  ContextEncoder::Workspace workspace_;
  AlignedFloats parameters_;
  std::vector<float> rows_;
  LatentPosterior posterior_;
};

TEST_F(PearlInference, PosteriorIsTheProductOfTheRowsFactors) {
  for (const std::size_t task : {0, 1}) {
    infer(task);
    for (const std::size_t j : {0, 1}) {
      const double variance = oracle_["posterior_variance"][task][j];
      EXPECT_NEAR(posterior_.mean[j], oracle_["posterior_mean"][task][j], kFloat);
      EXPECT_NEAR(posterior_.variance[j], variance, kFloat * variance);
    }
  }
}

TEST_F(PearlInference, DivergenceFromThePriorIsASumOverTasksAndDimensions) {
  double sum = 0;
  for (const std::size_t task : {0, 1}) {
    infer(task);
    const double kl = oracle_["kl_by_task"][task];
    EXPECT_NEAR(klToPrior(posterior_), kl, kFloat * kl);
    sum += klToPrior(posterior_);
  }
  EXPECT_NEAR(sum, oracle_["kl_sum"], kFloat * sum);
}

TEST_F(PearlInference, GradientOfTheDivergenceByTheHeads) {
  const std::vector<float> none(2);
  const std::vector<double> noise(2, 0.3);
  std::vector<float> by_mu, by_raw, gradient(encoder_.network().size());
  for (const std::size_t task : {0, 1}) {
    infer(task);
    encoder_.backward(parameters_.data(), rows_.data(), 4, posterior_, noise.data(), none.data(), 1,
                      workspace_, gradient.data());
    for (std::size_t i = 0; i < 4; ++i) {
      const float* row = &workspace_.d_heads[4 * i];
      by_mu.insert(by_mu.end(), row, row + 2);
      by_raw.insert(by_raw.end(), row + 2, row + 4);
    }
  }
  by_mu.insert(by_mu.end(), by_raw.begin(), by_raw.end());
  expectNear(by_mu, flat(oracle_["kl_gradient_mu_then_raw"]));
}

// the scalars of an update with a value network, in their order
TEST(PearlOracle, UpdateWithAValueNetwork) {
  const Json oracle = test::loadOracle("pearl_oracle.json")["pearl"]["sac_v"];
  const auto of = [&](const char* name) { return floats(oracle[name]); };
  constexpr std::size_t n = 3;
  const auto meanSquare = [&](const std::vector<float>& a, const std::vector<float>& b) {
    std::vector<float> errors(n), gradient(n);
    std::transform(a.begin(), a.end(), b.begin(), errors.begin(), std::minus<>());
    return kernels().squaredLoss(errors.data(), nullptr, gradient.data(), n);
  };

  std::vector<float> discounts = of("done");
  for (float& done : discounts) done = 0.99f * (1 - done);
  std::vector<float> y(n);
  criticTargets(of("rewards").data(), discounts.data(), of("v_target_next").data(), 5, n, y.data());
  expectNear(y, flat(oracle["q_target"]));
  EXPECT_NEAR(meanSquare(of("q1"), y) + meanSquare(of("q2"), y), oracle["q_loss"], kFloat);

  const std::vector<float> q1 = of("q1_new"), q2 = of("q2_new"), log_pi = of("log_pi");
  std::vector<float> v_target(n);
  softValues(q1.data(), q2.data(), log_pi.data(), 1, n, v_target.data());
  expectNear(v_target, flat(oracle["v_target"]));
  EXPECT_NEAR(meanSquare(of("v"), v_target), oracle["v_loss"], kFloat);

  std::vector<float> heads;
  for (std::size_t b = 0; b < n; ++b) {
    for (const char* part : {"policy_mean", "policy_log_std"}) {
      for (const double value : flat(oracle[part][b])) heads.push_back(static_cast<float>(value));
    }
  }
  const std::vector<float> noise(2 * n);
  GaussianPolicy policy(2, n, -20);
  policy.sampleWith(heads.data(), n, noise.data());
  std::vector<float> d_heads(heads.size());
  const double loss = actorLoss(q1.data(), q2.data(), log_pi.data(), 1, n) +
                      policy.addPenalty(n, 1e-3, d_heads.data());
  EXPECT_NEAR(loss, oracle["policy_loss"], kFloat * 4);
  for (std::size_t k = 0; k < heads.size(); ++k) {
    EXPECT_NEAR(d_heads[k], 2e-3 / 6 * heads[k], 1e-9);
  }
}

}  // namespace
}  // namespace pmeta
