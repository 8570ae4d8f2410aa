// MAML's and ProMP's mathematics, against an independent implementation and central differences.
#include "pmeta_core/baselines/inner_step.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "baselines/oracle.h"
#include "pmeta_core/baselines/adam.h"
#include "pmeta_core/baselines/maml_trpo.h"

namespace pmeta {
namespace {

using nlohmann::json;
using test::flat;
using test::relativeError;
using Vector = std::vector<double>;

constexpr double kAlpha = 0.1;
constexpr double kClip = 0.3;

class InnerStepTest : public testing::Test {
 protected:
  InnerStepTest() {
    for (const json& task : oracle_["tasks"]) {
      tasks_.push_back({dataOf(task["pre"]), dataOf(task["post"])});
    }
  }

  static ActionData dataOf(const json& entry) {
    ActionData data;
    data.rows = entry["adv"].size();
    data.observations = flat(entry["obs"]);
    data.actions = flat(entry["act"]);
    data.advantages = flat(entry["adv"]);
    data.old_mean = flat(entry["old_mean"]);
    data.old_log_std = flat(entry["old_log_std"]);
    data.old_log_prob = flat(entry["old_logp"]);
    return data;
  }

  static Surrogate kindOf(const std::string& name) {
    return name == "ratio" ? Surrogate::kRatio : Surrogate::kLogLikelihood;
  }

  const json oracle_ = test::loadOracle("maml_oracle.json")["policy"];
  const GaussianMlp policy_{3, {5, 4}, 2};
  const Vector theta_old_ = flat(oracle_["theta_old"]);
  const Vector direction_ = flat(oracle_["direction"]);
  std::vector<InnerStepData> tasks_;
};

TEST_F(InnerStepTest, ProbabilitiesAndLossesAreTheOnesExpected) {
  for (std::size_t i = 0; i < 2; ++i) {
    const ActionData& data = tasks_[i].before;
    for (std::size_t t = 0; t < data.rows; ++t) {
      EXPECT_NEAR(logProbability(&data.actions[2 * t], &data.old_mean[2 * t], data.old_log_std),
                  data.old_log_prob[t], 1e-12);
    }
    PolicyOnData before(policy_, data);
    before.at(theta_old_.data());
    const json& task = oracle_["tasks"][i];
    EXPECT_NEAR(before.loss(Surrogate::kLogLikelihood),
                task["inner_loss_log_likelihood"].get<double>(), 1e-12);
    EXPECT_NEAR(before.loss(Surrogate::kRatio), task["inner_loss_ratio"].get<double>(), 1e-12);
    EXPECT_NEAR(before.kl(), 0, 1e-12);
    Vector gradient(policy_.size());
    before.gradient(Surrogate::kLogLikelihood, gradient.data());
    EXPECT_LT(relativeError(gradient, flat(task["inner_gradient"])), 1e-12);
    Vector adapted(policy_.size());
    innerStep(policy_, data, Surrogate::kRatio, kAlpha, theta_old_.data(), adapted.data());
    EXPECT_LT(relativeError(adapted, flat(task["adapted"])), 1e-12);
  }
}

TEST_F(InnerStepTest, SecondDerivativesAreTheOnesExpected) {
  PolicyOnData before(policy_, tasks_[0].before);
  before.at(theta_old_.data());
  Vector product(policy_.size());
  for (const char* kind : {"log_likelihood", "ratio"}) {
    before.hessianProduct(kindOf(kind), direction_.data(), product.data());
    EXPECT_LT(relativeError(product, flat(oracle_["hvp"][kind])), 1e-12) << kind;
  }
  PolicyOnData after(policy_, tasks_[0].after);
  const Vector adapted = flat(oracle_["tasks"][0]["adapted"]);
  after.at(adapted.data());
  after.klProduct(direction_.data(), product.data());
  EXPECT_LT(relativeError(product, flat(oracle_["hvp"]["fisher_post_task0"])), 1e-12);
}

TEST_F(InnerStepTest, MetaGradientGoesThroughTheInnerStep) {
  for (const char* kind : {"log_likelihood", "ratio"}) {
    const json& expected = oracle_["maml"][kind];
    InnerStepObjective objective(policy_, tasks_, kindOf(kind), kAlpha);
    objective.at(theta_old_.data());
    EXPECT_NEAR(objective.loss(Surrogate::kRatio), expected["loss"].get<double>(), 1e-12);
    Vector result(policy_.size());
    objective.gradient(Surrogate::kRatio, result.data());
    EXPECT_LT(relativeError(result, flat(expected["gradient"])), 1e-10) << kind;
    EXPECT_GT(relativeError(result, flat(oracle_["maml"]["first_order_gradient"])), 0.3);
    objective.klProduct(direction_.data(), result.data());
    EXPECT_LT(relativeError(result, flat(expected["kl_hvp"])), 1e-10) << kind;
  }
}

TEST_F(InnerStepTest, TrustRegionStepIsTheOneExpected) {
  for (const char* kind : {"log_likelihood", "ratio"}) {
    for (const auto& [damping, tolerance] :
         // hardly damped, ten iterations magnify the last bits
         std::map<std::string, double>{{"damping_0.1", 1e-8}, {"damping_1e-05", 5e-6}}) {
      const json& expected = oracle_["maml"][kind]["trpo"][damping];
      TrustRegionSettings settings;
      settings.damping = damping == "damping_0.1" ? 0.1 : 1e-5;
      InnerStepObjective objective(policy_, tasks_, kindOf(kind), kAlpha);
      objective.at(theta_old_.data());
      const TrustRegionStep step = trustRegionStep(objective, theta_old_, settings);
      EXPECT_LT(relativeError(step.direction, flat(expected["direction"])), tolerance);
      EXPECT_NEAR(step.curvature / expected["curvature"].get<double>(), 1, tolerance);
      ASSERT_TRUE(step.accepted);
      EXPECT_EQ(static_cast<int>(step.tried.size()) - 1, expected["backtracks"].get<int>());
      Vector tried;
      for (const TriedStep& candidate : step.tried) {
        tried.insert(tried.end(), {candidate.loss, candidate.kl});
      }
      EXPECT_LT(relativeError(tried, flat(expected["loss_and_kl_tried"])), tolerance);
      EXPECT_LT(relativeError(step.parameters, flat(expected["theta"])), tolerance);
    }
  }
}

TEST_F(InnerStepTest, ParametersStayWhereNoStepIsGood) {
  InnerStepObjective objective(policy_, tasks_, Surrogate::kRatio, kAlpha);
  objective.at(theta_old_.data());
  TrustRegionSettings settings;
  settings.backtracks = 2;  // the seventh would be the first good one
  const TrustRegionStep step = trustRegionStep(objective, theta_old_, settings);
  EXPECT_FALSE(step.accepted);
  EXPECT_EQ(step.tried.size(), 2u);
  EXPECT_EQ(step.parameters, theta_old_);
}

TEST_F(InnerStepTest, ClippedSurrogateIsTheOneExpected) {
  const json& expected = oracle_["promp"];
  const Vector theta = flat(expected["theta"]);
  InnerStepObjective objective(policy_, tasks_, Surrogate::kRatio, kAlpha);
  objective.at(theta.data());
  Vector adapted, ratios;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vector& more = objective.adapted(i);
    adapted.insert(adapted.end(), more.begin(), more.end());
    for (std::size_t t = 0; t < 12; ++t) ratios.push_back(objective.ratio(i, t));
  }
  EXPECT_LT(relativeError(adapted, flat(expected["adapted"])), 1e-10);
  EXPECT_LT(relativeError(ratios, flat(expected["ratios"])), 1e-10);
  EXPECT_LT(relativeError(objective.innerKl(), flat(expected["inner_kl"])), 1e-10);

  const Vector kls = objective.innerKl();
  const double kl = (kls[0] + kls[1]) / 2;
  EXPECT_NEAR(objective.loss(Surrogate::kClippedRatio, kClip) + 5e-4 * kl,
              expected["loss"].get<double>(), 1e-10);
  Vector gradient(policy_.size()), of_kl(policy_.size());
  objective.gradient(Surrogate::kClippedRatio, gradient.data(), kClip);
  objective.innerKlGradient(of_kl.data());
  const auto with = [&](double eta) {
    Vector sum = gradient;
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += eta * of_kl[k];
    return sum;
  };
  EXPECT_LT(relativeError(with(5e-4), flat(expected["gradient"])), 1e-10);
  EXPECT_LT(relativeError(with(1), flat(expected["gradient_kl_coefficient_1"])), 1e-10);
}

TEST_F(InnerStepTest, StepsOfAdamOnTheClippedSurrogateAreTheOnesExpected) {
  const json& expected = oracle_["promp"]["adam"];
  Vector theta = theta_old_;
  InnerStepObjective objective(policy_, tasks_, Surrogate::kRatio, kAlpha);
  objective.at(theta.data());
  Adam adam(policy_.size(), expected["learning_rate"].get<double>());
  const auto loss = [&] {
    const Vector kls = objective.innerKl();
    return objective.loss(Surrogate::kClippedRatio, kClip) + 5e-4 * (kls[0] + kls[1]) / 2;
  };
  for (const json& before : expected["loss_before_each_epoch"]) {
    EXPECT_NEAR(loss(), before.get<double>(), 1e-10);
    Vector gradient(policy_.size()), of_kl(policy_.size());
    objective.gradient(Surrogate::kClippedRatio, gradient.data(), kClip);
    objective.innerKlGradient(of_kl.data());
    for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] += 5e-4 * of_kl[k];
    adam.step(theta.data(), gradient.data());
    objective.at(theta.data());
  }
  EXPECT_LT(relativeError(theta, flat(expected["theta_after_5"])), 1e-10);
  EXPECT_NEAR(loss(), expected["loss_after_5"].get<double>(), 1e-10);
}

// of the whole objective, through inner step and clipping
TEST_F(InnerStepTest, MetaGradientIsThatOfCentralDifferences) {
  const Vector theta = flat(oracle_["promp"]["theta"]);
  for (const Surrogate inner : {Surrogate::kRatio, Surrogate::kLogLikelihood}) {
    InnerStepObjective objective(policy_, tasks_, inner, kAlpha);
    objective.at(theta.data());
    Vector gradient(policy_.size());
    objective.gradient(Surrogate::kClippedRatio, gradient.data(), kClip);
    Vector numeric;
    for (std::size_t k = 0; k < theta.size(); ++k) {
      double side[2];
      for (const int sign : {0, 1}) {
        Vector moved = theta;
        moved[k] += (2 * sign - 1) * 1e-6;
        objective.at(moved.data());
        side[sign] = objective.loss(Surrogate::kClippedRatio, kClip);
      }
      numeric.push_back((side[1] - side[0]) / 2e-6);
    }
    EXPECT_LT(relativeError(gradient, numeric), 1e-8);
  }
}

TEST_F(InnerStepTest, LogStdBelowItsFloorHasNoGradient) {
  Vector theta = theta_old_;
  theta[policy_.logStdOffset()] = -20;
  EXPECT_DOUBLE_EQ(policy_.logStd(theta.data())[0], std::log(1e-6));
  PolicyOnData on_data(policy_, tasks_[0].before);
  on_data.at(theta.data());
  Vector gradient(policy_.size());
  on_data.gradient(Surrogate::kLogLikelihood, gradient.data());
  EXPECT_EQ(gradient[policy_.logStdOffset()], 0);
  EXPECT_NE(gradient[policy_.logStdOffset() + 1], 0);
}

}  // namespace
}  // namespace pmeta
