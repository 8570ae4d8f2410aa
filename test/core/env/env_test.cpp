#include "pmeta_core/env/env.h"

#include <gtest/gtest.h>

#include <algorithm>
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

// a family with its default settings, or with those of a file where it has none
std::unique_ptr<EnvFamily> familyOf(const std::string& name) {
  auto family = envFamilies().at(name)();
  if (name == "mjcf") {
    YAML::Node file = loadYamlFile(PMETA_TEST_DATA "/mjcf/ant_fwd_back.yaml");
    file.remove("experiment");
    file.remove("learner");
    file["environment"].remove("name");
    Settings settings;
    family->outline(listedSettings(file));
    family->bind(settings);
    settings.read(file, "ant_fwd_back.yaml");
    family->model()->file = std::string(PMETA_TEST_DATA "/mjcf/") + family->model()->file;
  }
  family->build(0);
  return family;
}

// all but those whose environments are elsewhere
std::vector<std::string> simulatedFamilies() {
  std::vector<std::string> names = envFamilies().names();
  names.erase(std::remove(names.begin(), names.end(), "remote"), names.end());
  return names;
}

// training and test tasks have names of their own, and the environments that the names promise
TEST(Env, FamiliesTellTheirTasksApart) {
  for (const std::string& name : simulatedFamilies()) {
    const auto family = familyOf(name);
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
  for (const std::string& name : simulatedFamilies()) {
    const auto family = familyOf(name);
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

// a random action within the bounds that the environment tells
void drawAction(const EnvSpec& spec, Rng& rng, std::vector<double>& action) {
  for (std::size_t i = 0; i < action.size(); ++i) {
    const Quantity& one = spec.action[i];
    action[i] = spec.num_actions > 0 ? static_cast<double>(rng.below(spec.num_actions))
                                     : one.low + (one.high - one.low) * rng.uniform();
  }
}

TEST(EnvSpec, ShippedFamiliesDescribeAllTheirNumbersAndKeepTheBounds) {
  constexpr double kRounding = 1e-9;
  for (const std::string& name : simulatedFamilies()) {
    SCOPED_TRACE(name);
    const auto family = familyOf(name);
    for (int task = 0; task < family->numTasks(); task += 3) {
      const auto env = family->make(task);
      const EnvSpec& spec = env->spec();
      ASSERT_EQ(spec.observation.size(), static_cast<std::size_t>(spec.observation_size));
      ASSERT_EQ(spec.action.size(), static_cast<std::size_t>(spec.action_size));
      ASSERT_EQ(spec.choices.size(), static_cast<std::size_t>(spec.num_actions));
      EXPECT_EQ(observationsOf(spec).size(), spec.observation.size());
      EXPECT_EQ(actionsOf(spec).size(), spec.action.size());
      for (const Quantity& one : spec.action) EXPECT_LT(one.high - one.low, 100) << one.name;

      std::vector<double> observation(spec.observation.size()), action(spec.action.size());
      const auto expectInBounds = [&] {
        for (std::size_t i = 0; i < observation.size(); ++i) {
          EXPECT_GE(observation[i], spec.observation[i].low - kRounding)
              << spec.observation[i].name;
          EXPECT_LE(observation[i], spec.observation[i].high + kRounding)
              << spec.observation[i].name;
        }
      };
      Rng rng(7, task, Stream::kMeasure);
      for (int episode = 0; episode < 5; ++episode) {
        env->reset(rng, observation.data());
        Step step;
        while (!step.terminated && !step.truncated) {
          expectInBounds();
          drawAction(spec, rng, action);
          step = env->step(action.data(), rng, observation.data());
        }
        if (!step.terminated) expectInBounds();
      }
    }
  }
}

TEST(EnvSpec, RestorableIsWhatRestores) {
  for (const std::string& name : simulatedFamilies()) {
    const auto family = familyOf(name);
    const auto env = family->make(0);
    EXPECT_TRUE(env->spec().restorable) << name;
    std::vector<double> observation(env->spec().observation.size());
    Rng rng(1, 0, Stream::kMeasure);
    env->reset(rng, observation.data());
    EXPECT_NO_THROW(env->setState(env->state())) << name;
  }
  EXPECT_FALSE(Closed().spec().restorable);
  EXPECT_THROW(Closed().setState({1}), Error);
}

TEST(EnvSpec, WhatIsNotDescribedIsNumbered) {
  const EnvSpec discrete{"closed", 2, 1, 3, 10};
  EXPECT_EQ(observationsOf(discrete).at(1).name, "observation_1");
  EXPECT_EQ(observationsOf(discrete).at(1).low, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(actionsOf(discrete).at(0).name, "action_0");
  EXPECT_EQ(actionsOf(discrete).at(0).high, 2);
  const EnvSpec continuous{"closed", 2, 2, 0, 10};
  EXPECT_EQ(actionsOf(continuous).at(1).low, -1);
  EXPECT_EQ(actionsOf(continuous).at(1).high, 1);
}

TEST(EnvSpec, HalfADescriptionAndNamesThatAreTakenAreRefused) {
  EnvSpec spec{"closed", 2, 1, 3, 10};
  spec.observation = {{"x", "m"}};
  EXPECT_EQ(errorOf([&] { observationsOf(spec); }),
            "environment 'closed' describes 1 numbers of its observation, which has 2: describe "
            "all of them or none.");
  spec.observation = {{"x", "m"}, {"x", "m"}};
  EXPECT_EQ(errorOf([&] { observationsOf(spec); }),
            "environment 'closed' names two numbers of its observation 'x': give each a name of "
            "its own.");
  spec.action = {{"to push", ""}};
  EXPECT_EQ(errorOf([&] { actionsOf(spec); }),
            "environment 'closed' names a number of its action 'to push': a name has no blanks and "
            "no commas, and is not empty.");
}

}  // namespace
}  // namespace pmeta
