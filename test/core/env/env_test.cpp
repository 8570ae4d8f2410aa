#include "pmeta_core/env/env.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

// an environment that says nothing about its state
class Closed : public Env {
 public:
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng&, double*) override {}
  Step step(const double*, Rng&, double*) override { return {}; }

 private:
  EnvSpec spec_{"closed", 1, 1, 2, 10};
};

TEST(Env, ThatKeepsItsStateToItselfSaysSo) {
  Closed env;
  EXPECT_EQ(errorOf([&] { env.state(); }), "environment 'closed' cannot hand out its state.");
  EXPECT_EQ(errorOf([&] { env.setState({1}); }), "environment 'closed' cannot take up a state.");
}

TEST(Env, StatesAreCheckedForSizeNumbersAndSteps) {
  const EnvSpec spec{"closed", 1, 1, 2, 10};
  const auto refused = [&](const std::vector<double>& state) {
    return errorOf([&] { requireState(spec, state, 2); });
  };
  EXPECT_EQ(refused({-1.5, 3}), "(no error)");
  EXPECT_EQ(refused({1}), "a state of closed has 1 numbers but must have 2.");
  EXPECT_EQ(refused({std::numeric_limits<double>::quiet_NaN(), 3}),
            "a state of closed holds a number that is not finite.");
  for (const double steps : {-1.0, 0.5, 1e300}) {
    EXPECT_EQ(refused({1, steps}),
              "a state of closed counts " + formatNumber(steps) + " steps, which is not a count.");
  }
}

TEST(Env, AStepIsJudgedByItsSparseRewardIfItHasOne) {
  EXPECT_EQ((Step{-2, false, false}).evaluatedReward(), -2);
  EXPECT_EQ((Step{-2, false, false, 0.5}).evaluatedReward(), 0.5);
  EXPECT_EQ((Step{-2, false, false, 0}).evaluatedReward(), 0);
}

// training and test tasks have names of their own, and the environments that the names promise
TEST(Env, FamiliesTellTheirTasksApart) {
  for (const std::string& name : envFamilies().names()) {
    const auto family = envFamilies().at(name)();
    family->build(0);
    std::set<std::string> names;
    const int count = family->numTasks() + family->numTestTasks();
    for (int task = 0; task < count; ++task) {
      EXPECT_TRUE(names.insert(family->taskName(task)).second) << family->taskName(task);
      EXPECT_EQ(family->taskName(task).find_first_of(" ,"), std::string::npos);
      EXPECT_FALSE(family->taskDescription(task).empty());
      EXPECT_EQ(family->make(task)->spec().name, name);
      const bool is_test = family->taskName(task).find("_test_") != std::string::npos;
      EXPECT_EQ(is_test, task >= family->numTasks()) << family->taskName(task);
    }
  }
}

// every family hands out states that go on as the original does
TEST(Env, GoesOnFromItsState) {
  for (const std::string& name : envFamilies().names()) {
    const auto family = envFamilies().at(name)();
    family->build(0);
    const auto one = family->make(0), other = family->make(0);
    const EnvSpec& spec = one->spec();
    std::vector<double> seen(spec.observation_size), again(spec.observation_size);
    Rng rng(1, 0, Stream::kMeasure);
    one->reset(rng, seen.data());
    bool over = false;
    while (!over) {
      other->setState(one->state());
      EXPECT_EQ(other->state(), one->state());
      std::vector<double> action(spec.action_size);
      for (double& a : action) {
        a = spec.num_actions > 0 ? static_cast<double>(rng.below(spec.num_actions))
                                 : 2 * rng.uniform() - 1;
      }
      const Step a = one->step(action.data(), rng, seen.data());
      const Step b = other->step(action.data(), rng, again.data());
      ASSERT_EQ(seen, again) << name;
      ASSERT_EQ(a.reward, b.reward);
      ASSERT_EQ(a.sparse_reward, b.sparse_reward);
      ASSERT_EQ(a.terminated, b.terminated);
      ASSERT_EQ(a.truncated, b.truncated);
      over = a.terminated || a.truncated;
    }
    EXPECT_EQ(one->state(), other->state()) << name;
    EXPECT_EQ(errorOf([&] { one->setState({}); }), "a state of " + spec.name +
                                                       " has 0 numbers but must have " +
                                                       std::to_string(other->state().size()) + ".");
  }
}

}  // namespace
}  // namespace pmeta
