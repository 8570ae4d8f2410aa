#include <gtest/gtest.h>

#include "../support.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {
namespace {

using test::errorOf;

TEST(Learner, MustFitTheEnvironment) {
  const auto tabular = Experiment::parse("environment: {name: cart_pole}", "test");
  EXPECT_EQ(errorOf([&] { tabular.makeLearner(0); }),
            "environment 'cart_pole' is not tabular, so q_learning cannot learn it: choose "
            "another learner.");
}

TEST(Learner, SettingsOfOthersAreUnknown) {
  EXPECT_NE(errorOf([] { Experiment::parse("dqn: {n_step: 1}", "test"); }).find("unknown setting"),
            std::string::npos);
  EXPECT_NE(errorOf([] {
              Experiment::parse("learner: dqn\nq_learning: {gamma: 0}", "test");
            }).find("unknown setting"),
            std::string::npos);
}

TEST(Learner, UnknownOnesAreToldTheKnownOnes) {
  EXPECT_EQ(
      errorOf([] { Experiment::parse("learner: sca", "test"); }),
      "unknown learner 'sca': did you mean 'sac'? Known are " + join(learners().names()) + ".");
}

TEST(Learner, ANetworkMayHaveALambdaOfItsOwn) {
  const auto load = [](const std::string& own) {
    return Experiment::parse(
        "learner: sac\nenvironment: {name: sparse_point_robot}\n"
        "personal: {lambda_critic: " +
            own + "}",
        "test");
  };
  EXPECT_FALSE(load("-1").settings().personal.lambdas.critic.has_value());
  EXPECT_EQ(load("0").settings().personal.lambdas.critic, 0);
  EXPECT_NE(load("-1").yaml().find("lambda_critic: -1\n"), std::string::npos);
  EXPECT_NE(errorOf([&] { load("-0.5"); }).find("a number, at least 0, or -1"), std::string::npos);
}

TEST(Stability, OfNetworksOnlyThePullCounts) {
  const auto load = [](const std::vector<std::string>& overrides) {
    return Experiment::parse(
        "learner: dqn\nenvironment: {name: cart_pole}\n"
        "personal: {alpha: 0.001, lambda: 20, eta: 0.01}",
        "test", overrides);
  };
  EXPECT_TRUE(load({}).notes().empty());
  EXPECT_EQ(errorOf([&] { load({"alpha:=0.1"}); }),
            "personal.alpha = 0.1 with personal.lambda = 20 diverges: alpha must be below "
            "2 / lambda = 0.1.");
  EXPECT_EQ(load({"alpha:=0.06"}).notes().size(), 1u);
}

}  // namespace
}  // namespace pmeta
