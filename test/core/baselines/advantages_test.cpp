#include "pmeta_core/baselines/advantages.h"

#include <gtest/gtest.h>

#include "baselines/oracle.h"
#include "support.h"

namespace pmeta {
namespace {

using test::flat;
using test::relativeError;

class AdvantagesTest : public testing::Test {
 protected:
  AdvantagesTest() {
    for (const auto& entry : oracle_["paths"]) {
      paths_.push_back({flat(entry["obs"]), flat(entry["rewards"]), flat(entry["last_obs"]),
                        entry["ended"] == "terminated"});
    }
    baseline_.fit(paths_, 0.99);
  }

  const nlohmann::json oracle_ = test::loadOracle("maml_oracle.json")["advantages"];
  std::vector<Path> paths_;
  LinearBaseline baseline_;
};

TEST_F(AdvantagesTest, ReturnsAndBaselineAreTheOnesExpected) {
  EXPECT_LT(relativeError(baseline_.coefficients(), flat(oracle_["coefficients"])), 1e-10);
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    const auto& expected = oracle_["paths"][i];
    EXPECT_LT(relativeError(discountedReturns(paths_[i].rewards, 0.99), flat(expected["returns"])),
              1e-12);
    std::vector<double> values;
    for (std::size_t t = 0; t < paths_[i].steps(); ++t) {
      values.push_back(baseline_.value(&paths_[i].observations[2 * t], 2, t));
    }
    EXPECT_LT(relativeError(values, flat(expected["baseline"])), 1e-10);
  }
}

TEST_F(AdvantagesTest, AdvantagesAreTheOnesExpected) {
  for (const double lambda : {1.0, 0.95}) {
    for (const bool bootstrap : {false, true}) {
      const std::string key = std::string(lambda == 1 ? "lambda_1_" : "lambda_0.95_") +
                              (bootstrap ? "bootstrap" : "reference");
      std::vector<double> all = advantages(paths_, baseline_, {0.99, lambda, bootstrap});
      EXPECT_LT(relativeError(all, flat(oracle_["advantages"][key]["raw"])), 1e-10) << key;
      normalise(all);
      EXPECT_LT(relativeError(all, flat(oracle_["advantages"][key]["normalised"])), 1e-10) << key;
    }
  }
}

TEST(Advantages, EqualFeaturesHaveABaselineToo) {
  const Path path{{1, 1, 1}, {2, 2, 2}, {1}, false};
  LinearBaseline baseline;
  baseline.fit({path}, 0.5);
  EXPECT_NEAR(baseline.value(&path.observations[0], 1, 0), 3.5, 0.1);  // by the time alone
}

TEST(Advantages, WithoutAStepThereIsNoBaseline) {
  LinearBaseline baseline;
  EXPECT_EQ(test::errorOf([&] { baseline.fit({}, 0.9); }),
            "a baseline cannot be fitted to no step at all.");
}

}  // namespace
TEST(GeneralisedAdvantages, AreSumsOfErrorsToTheEndOfThePath) {
  const std::vector<float> rewards = {1, -2, 0.5f}, values = {0.25f, 1, -1};
  const double gamma = 0.9, lambda = 0.8;
  std::vector<float> found(3);
  generalisedAdvantages(rewards.data(), values.data(), 3, 0, gamma, lambda, found.data());
  const double d2 = 0.5 + 1, d1 = -2 - gamma - 1, d0 = 1 + gamma - 0.25;
  EXPECT_NEAR(found[2], d2, 1e-6);
  EXPECT_NEAR(found[1], d1 + gamma * lambda * d2, 1e-6);
  EXPECT_NEAR(found[0], d0 + gamma * lambda * (d1 + gamma * lambda * d2), 1e-6);
  // lambda 1: the discounted return less the value
  generalisedAdvantages(rewards.data(), values.data(), 3, 0, gamma, 1, found.data());
  EXPECT_NEAR(found[0], 1 - 2 * gamma + 0.5 * gamma * gamma - 0.25, 1e-6);
}

}  // namespace pmeta
