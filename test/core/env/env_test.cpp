#include "pmeta_core/env/env.h"

#include <gtest/gtest.h>

#include <limits>

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

// every family hands out states that go on as the original does
TEST(Env, GoesOnFromItsState) {
  for (const std::string name : {"gridworld", "cart_pole", "mountain_car"}) {
    const auto family = makeEnvFamily(name);
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
      const double action = static_cast<double>(rng.below(spec.num_actions));
      const Step a = one->step(&action, rng, seen.data());
      const Step b = other->step(&action, rng, again.data());
      ASSERT_EQ(seen, again) << name;
      ASSERT_EQ(a.reward, b.reward);
      ASSERT_EQ(a.terminated, b.terminated);
      ASSERT_EQ(a.truncated, b.truncated);
      over = a.terminated || a.truncated;
    }
    EXPECT_EQ(one->state(), other->state()) << name;
    EXPECT_EQ(errorOf([&] { one->setState({}); }), "a state of " + name +
                                                       " has 0 numbers but must have " +
                                                       std::to_string(other->state().size()) + ".");
  }
}

}  // namespace
}  // namespace pmeta
