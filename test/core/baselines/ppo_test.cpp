#include "pmeta_core/baselines/ppo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/baselines/rl2.h"
#include "pmeta_core/baselines/running_variance.h"

namespace pmeta {
namespace {

// a batch in which every case of both minima occurs, and what the networks give for it
struct Case {
  static constexpr std::size_t kSteps = 60, kActions = 2;

  explicit Case(const std::vector<float>& log_std) : log_std(log_std) {
    Rng rng(1, 0, Stream::kMeasure);
    const auto draw = [&](std::vector<float>& values, std::size_t n, double size) {
      for (std::size_t k = 0; k < n; ++k) values.push_back(static_cast<float>(size * rng.normal()));
    };
    draw(means, kSteps * kActions, 1);
    draw(values, kSteps, 1);
    draw(old_values, kSteps, 1);
    draw(advantages, kSteps, 1);
    draw(returns, kSteps, 1.5);
    std::vector<float> shifts;
    draw(shifts, kSteps, 0.3);
    for (std::size_t t = 0; t < kSteps; ++t) {
      for (std::size_t j = 0; j < kActions; ++j) {
        const double std = std::exp(std::max<double>(log_std[j], kLowestLogStd));
        actions.push_back(means[t * kActions + j] + static_cast<float>(std * rng.normal()));
      }
      old_log_densities.push_back(
          shifts[t] + static_cast<float>(logDensity(&actions[t * kActions], &means[t * kActions],
                                                    log_std.data(), kActions)));
    }
  }

  PpoLoss loss(const PpoSettings& settings) {
    const PpoBatch batch = {kSteps,
                            kActions,
                            actions.data(),
                            old_log_densities.data(),
                            old_values.data(),
                            advantages.data(),
                            returns.data()};
    d_means.assign(means.size(), -99);
    d_values.assign(values.size(), -99);
    d_log_std.assign(kActions, -99);
    return ppo(settings, batch, means.data(), log_std.data(), values.data(),
               {d_means.data(), d_values.data(), d_log_std.data()});
  }

  std::vector<float> log_std, means, values, old_values, advantages, returns, actions;
  std::vector<float> old_log_densities, d_means, d_values, d_log_std;
};

// each gradient against the slope of the loss over a step that single precision resolves
void expectGradients(Case& batch, const PpoSettings& settings) {
  const auto check = [&](std::vector<float>& at, const std::vector<float>& gradient) {
    for (std::size_t k = 0; k < at.size(); ++k) {
      const float here = at[k], h = 1e-3f;
      at[k] = here + h;
      const double high = at[k], above = batch.loss(settings).total(settings);
      at[k] = here - h;
      const double low = at[k], below = batch.loss(settings).total(settings);
      at[k] = here;
      EXPECT_NEAR(gradient[k], (above - below) / (high - low), 1e-4) << k;
    }
  };
  batch.loss(settings);
  const auto d_means = batch.d_means, d_values = batch.d_values, d_log_std = batch.d_log_std;
  check(batch.means, d_means);
  check(batch.values, d_values);
  check(batch.log_std, d_log_std);
}

TEST(Ppo, GradientsAgreeWithCentralDifferences) {
  for (const bool huber : {false, true}) {
    for (const bool clip_values : {false, true}) {
      PpoSettings settings;
      settings.clip = 0.2;
      settings.huber = huber;
      settings.clip_values = clip_values;
      settings.entropy_coefficient = 0.1;
      Case batch({-0.5f, 0.3f});
      const PpoLoss loss = batch.loss(settings);
      EXPECT_GT(loss.clipped, 0.2);
      EXPECT_LT(loss.clipped, 0.8);
      expectGradients(batch, settings);
    }
  }
}

TEST(Ppo, BelowItsFloorTheLogStdActsAsAtItAndStays) {
  const float action = 1e-6f, mean = 0;
  const float low = -20, floor = static_cast<float>(kLowestLogStd);
  EXPECT_NEAR(logDensity(&action, &mean, &low, 1), logDensity(&action, &mean, &floor, 1), 1e-5);
  Case batch({-20, 0});
  batch.loss({});
  EXPECT_EQ(batch.d_log_std[0], 0);
  EXPECT_NE(batch.d_log_std[1], 0);
}

TEST(Ppo, TheLossIsMadeOfItsParts) {
  PpoSettings settings;
  settings.value_coefficient = 0;
  settings.entropy_coefficient = 0;
  Case batch({0, 0});
  const PpoLoss loss = batch.loss(settings);
  EXPECT_DOUBLE_EQ(loss.total(settings), loss.policy);
  EXPECT_NEAR(loss.entropy, 2 * (0.5 + 0.5 * std::log(2 * M_PI)), 1e-12);
  for (const float d : batch.d_values) EXPECT_EQ(d, 0);
}

TEST(RunningVariance, IsThatOfAllNumbers) {
  RunningVariance variance;
  EXPECT_EQ(variance.variance(), 1);
  for (const double value : {1e6 + 4, 1e6 + 7, 1e6 + 13, 1e6 + 16}) variance.add(value);
  EXPECT_NEAR(variance.variance(), 22.5, 1e-9);
}

}  // namespace
}  // namespace pmeta
