#include "pmeta_core/act/gaussian_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace pmeta {
namespace {

// log pi(a) in double, by the density of u and the slope of tanh
double logProb(const std::vector<double>& heads, const std::vector<double>& noise) {
  const std::size_t n = noise.size();
  double sum = 0;
  for (std::size_t j = 0; j < n; ++j) {
    const double std = std::exp(std::min(std::max(heads[n + j], -5.0), 2.0));
    const double u = heads[j] + std * noise[j];
    sum += -0.5 * noise[j] * noise[j] - std::log(std * std::sqrt(2 * M_PI));
    sum -= 2 * (std::log(2) - std::abs(u) - std::log1p(std::exp(-2 * std::abs(u))));
  }
  return sum;
}

TEST(GaussianPolicy, ActionsAndLogProbsAgreeWithDouble) {
  const std::size_t n = 3, batch = 400;
  Rng rng(1, 0, Stream::kMeasure);
  std::vector<float> heads(batch * 2 * n), noise(batch * n);
  for (float& x : heads) x = static_cast<float>(6 * rng.normal());
  for (float& x : noise) x = static_cast<float>(rng.normal());
  GaussianPolicy policy(n, batch);
  policy.sampleWith(heads.data(), batch, noise.data());
  for (std::size_t b = 0; b < batch; ++b) {
    const std::vector<double> h(&heads[2 * n * b], &heads[2 * n * b] + 2 * n);
    const std::vector<double> e(&noise[n * b], &noise[n * b] + n);
    const double expected = logProb(h, e);
    EXPECT_NEAR(policy.logProbs()[b], expected, 1e-5 * (1 + std::abs(expected)));
    for (std::size_t j = 0; j < n; ++j) {
      const double std = std::exp(std::min(std::max(h[n + j], -5.0), 2.0));
      EXPECT_NEAR(policy.actions()[n * b + j], std::tanh(h[j] + std * e[j]), 1e-5);
    }
  }
}

TEST(GaussianPolicy, DensityOfActionsIntegratesToOne) {
  // one component; a grid over u gives all of (-1, 1), with da = (1 - a^2) du
  for (const float mean : {-1.5f, 0.2f}) {
    for (const float log_std : {-2.0f, 0.3f}) {
      const std::vector<float> heads = {mean, log_std};
      GaussianPolicy policy(1, 1);
      double integral = 0;
      const double step = 0.01;
      for (double u = mean - 12; u < mean + 12; u += step) {
        const auto noise = static_cast<float>((u - mean) / std::exp(double{log_std}));
        policy.sampleWith(heads.data(), 1, &noise);
        const double slope = 1 / std::pow(std::cosh(u), 2);
        integral += std::exp(policy.logProbs()[0]) * slope * step;
      }
      EXPECT_NEAR(integral, 1, 1e-4);
    }
  }
}

TEST(GaussianPolicy, GradientAgreesWithCentralDifferences) {
  const std::size_t n = 2, batch = 60;
  Rng rng(2, 0, Stream::kMeasure);
  std::vector<float> heads(batch * 2 * n), noise(batch * n), d_action(batch * n);
  for (float& x : heads) x = static_cast<float>(rng.normal());
  for (std::size_t b = 0; b < 10; ++b) heads[2 * n * b + n] = b % 2 == 0 ? -5.5f : 2.5f;  // clamped
  for (float& x : noise) x = static_cast<float>(rng.normal());
  for (float& x : d_action) x = static_cast<float>(rng.normal());
  const double d_log_prob = 0.7;
  GaussianPolicy policy(n, batch);
  policy.sampleWith(heads.data(), batch, noise.data());
  std::vector<float> d_heads(heads.size());
  policy.backward(batch, d_action.data(), static_cast<float>(d_log_prob), d_heads.data());

  for (std::size_t b = 0; b < batch; ++b) {
    std::vector<double> h(&heads[2 * n * b], &heads[2 * n * b] + 2 * n);
    const std::vector<double> e(&noise[n * b], &noise[n * b] + n);
    const auto loss = [&] {
      double sum = d_log_prob * logProb(h, e);
      for (std::size_t j = 0; j < n; ++j) {
        const double std = std::exp(std::min(std::max(h[n + j], -5.0), 2.0));
        sum += d_action[n * b + j] * std::tanh(h[j] + std * e[j]);
      }
      return sum;
    };
    for (std::size_t j = 0; j < 2 * n; ++j) {
      const double step = 1e-6, at = h[j];
      h[j] = at + step;
      const double above = loss();
      h[j] = at - step;
      const double below = loss();
      h[j] = at;
      const double expected = (above - below) / (2 * step);
      EXPECT_NEAR(d_heads[2 * n * b + j], expected, 1e-4 * (1 + std::abs(expected)));
    }
  }
  for (std::size_t b = 0; b < 10; ++b) EXPECT_EQ(d_heads[2 * n * b + n], 0);
}

TEST(GaussianPolicy, SamplesHaveTheMomentsOfTheHeads) {
  const std::size_t batch = 4000;
  std::vector<float> heads;
  for (std::size_t b = 0; b < batch; ++b) heads.insert(heads.end(), {0.3f, -1.0f});
  GaussianPolicy policy(1, batch);
  Rng rng(3, 0, Stream::kMeasure), same = rng;
  policy.sample(heads.data(), batch, rng);
  double sum = 0, squares = 0;
  for (std::size_t b = 0; b < batch; ++b) {
    const double u = std::atanh(double{policy.actions()[b]});
    sum += u;
    squares += (u - 0.3) * (u - 0.3);
  }
  const double n = batch, std = std::exp(-1.0);
  EXPECT_NEAR(sum / n, 0.3, 4 * std / std::sqrt(n));
  EXPECT_NEAR(squares / n, std * std, 4 * std * std * std::sqrt(2 / n));
  const float first = policy.actions()[0];
  policy.sample(heads.data(), 1, same);
  EXPECT_EQ(policy.actions()[0], first);
}

TEST(GaussianPolicy, MeanActionIsTanhOfTheMean) {
  const std::vector<float> heads = {0.5f, -2, 7, 7, 0, 3, 7, 7};
  double actions[4];
  meanActions(heads.data(), 2, 2, actions);
  EXPECT_DOUBLE_EQ(actions[0], std::tanh(0.5));
  EXPECT_DOUBLE_EQ(actions[1], std::tanh(-2.0));
  EXPECT_EQ(actions[2], 0);
  EXPECT_DOUBLE_EQ(actions[3], std::tanh(3.0));
}

}  // namespace
}  // namespace pmeta
