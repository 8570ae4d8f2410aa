#include "pmeta_core/learn/temperature.h"

#include <gtest/gtest.h>

#include <cmath>

#include "../memory_state.h"

namespace pmeta {
namespace {

TEST(Temperature, RisesWhileThePolicyIsTooCertainAndFallsWhileItIsTooRandom) {
  Temperature certain({}, 3), random({}, 3);
  EXPECT_EQ(certain.targetEntropy(), -3);
  EXPECT_DOUBLE_EQ(certain.value(), 0.2);
  certain.update(5);  // entropy -5 is below -3
  random.update(2);   // entropy -2 is above
  EXPECT_GT(certain.value(), 0.2);
  EXPECT_LT(random.value(), 0.2);
}

TEST(Temperature, GradientIsTheLosss) {
  TemperatureSettings settings;
  settings.target_entropy = -1.5;
  const Temperature temperature(settings, 3);
  const double h = 1e-5, mean_log_prob = 0.8;
  const auto loss = [&](double log_alpha) { return -log_alpha * (mean_log_prob + -1.5); };
  EXPECT_NEAR(temperature.gradient(mean_log_prob), (loss(h) - loss(-h)) / (2 * h), 1e-9);
}

TEST(Temperature, StepsAreAdams) {
  Temperature temperature({}, 2);
  double x = std::log(0.2), m = 0, v = 0;
  for (int t = 1; t <= 20; ++t) {
    const double mean_log_prob = std::sin(t);
    const double g = -(mean_log_prob - 2);
    m = 0.9 * m + 0.1 * g;
    v = 0.999 * v + 0.001 * g * g;
    x -= 1e-3 * (m / (1 - std::pow(0.9, t))) / (std::sqrt(v / (1 - std::pow(0.999, t))) + 1e-8);
    temperature.update(mean_log_prob);
    EXPECT_NEAR(temperature.value(), std::exp(x), 1e-12);
  }
}

TEST(Temperature, StaysWhereFixed) {
  TemperatureSettings settings;
  settings.temperature = "fixed";
  settings.initial_temperature = 0.7;
  Temperature temperature(settings, 2);
  temperature.update(10);
  EXPECT_DOUBLE_EQ(temperature.value(), 0.7);
}

TEST(Temperature, GoesOnFromItsState) {
  Temperature a({}, 2), b({}, 2);
  for (int t = 0; t < 5; ++t) a.update(t);
  test::load(b, test::stateOf(a));
  a.update(3);
  b.update(3);
  EXPECT_EQ(a.value(), b.value());
}

}  // namespace
}  // namespace pmeta
