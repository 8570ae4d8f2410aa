#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../allocations.h"
#include "../support.h"
#include "pmeta_core/env/env.h"

namespace pmeta::test {

/// An environment with continuous actions, with its observation at hand.
struct Driven {
  explicit Driven(Env& environment)
      : env(environment),
        observation(static_cast<std::size_t>(env.spec().observation_size)),
        action(static_cast<std::size_t>(env.spec().action_size)) {}

  void reset() { env.reset(rng, observation.data()); }
  Step step() { return env.step(action.data(), rng, observation.data()); }

  /// Steps with an action that is drawn uniformly from [-1, 1].
  Step randomStep() {
    for (double& a : action) a = 2 * rng.uniform() - 1;
    return step();
  }

  Env& env;
  Rng rng{1, 0, Stream::kMeasure};
  std::vector<double> observation;
  std::vector<double> action;
};

/// The family of `Family` with settings as a program gives them.
template <class Family>
struct BuiltFamily {
  Family family;
  Settings settings;
  explicit BuiltFamily(const std::vector<std::string>& assignments = {}, std::uint64_t seed = 0) {
    family.bind(settings);
    for (const std::string& one : assignments) settings.assign(one);
    family.build(seed);
  }
};

/// What BuiltFamily throws.
template <class Family>
std::string familyError(const std::vector<std::string>& assignments) {
  return errorOf([&] { BuiltFamily<Family> built(assignments); });
}

inline void expectNoAllocationInSteps(Env& env) {
  Driven driven(env);
  driven.reset();
  const std::size_t before = allocations();
  for (int i = 0; i < 60; ++i) {
    const Step step = driven.randomStep();
    if (step.terminated || step.truncated) driven.reset();
  }
  EXPECT_EQ(allocations() - before, 0u) << env.spec().name;
}

inline void expectClippedActions(Env& env) {
  Driven driven(env);
  driven.reset();
  const std::vector<double> start = env.state();
  std::fill(driven.action.begin(), driven.action.end(), 1);
  const Step at_limit = driven.step();
  const std::vector<double> after = env.state();
  env.setState(start);
  std::fill(driven.action.begin(), driven.action.end(), 7);
  const Step beyond = driven.step();
  EXPECT_EQ(env.state(), after);
  EXPECT_EQ(beyond.reward, at_limit.reward);
}

/// Of `count` numbers in [low, high): that they look uniform (99.99 %, 9 degrees of freedom).
inline void expectUniform(const std::vector<double>& numbers, double low, double high) {
  std::vector<int> counts(10);
  for (const double x : numbers) {
    ASSERT_GE(x, low);
    ASSERT_LT(x, high);
    ++counts[std::min(9, static_cast<int>(10 * (x - low) / (high - low)))];
  }
  EXPECT_LT(chiSquare(counts), 33.7);
}

/// That numbers look normal with mean 0: their deviation, and how many lie within one of it.
inline void expectNormal(const std::vector<double>& numbers, double deviation) {
  const double n = static_cast<double>(numbers.size());
  double sum = 0, squares = 0, within = 0;
  for (const double x : numbers) {
    sum += x;
    squares += x * x;
    within += std::abs(x) < deviation ? 1 : 0;
  }
  EXPECT_NEAR(sum / n, 0, 4 * deviation / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), deviation, 4 * deviation / std::sqrt(2 * n));
  EXPECT_NEAR(within / n, 0.682689, 4 * 0.466 / std::sqrt(n));
}

}  // namespace pmeta::test
