#include "pmeta_core/learn/context_encoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "../support.h"

namespace pmeta {
namespace {

ContextSettings smallSettings() {
  ContextSettings settings;
  settings.hidden = {9, 7};
  settings.latent_size = 3;
  return settings;
}

struct Encoding {
  explicit Encoding(const ContextSettings& settings = smallSettings(), std::size_t rows = 12,
                    std::size_t room = 12)
      : encoder(2, 1, settings),
        workspace(encoder, room),
        parameters(encoder.network().size()),
        context(rows * encoder.rowSize()) {
    Rng rng(5, 0, Stream::kInitialise);
    encoder.network().initialise(parameters.data(), rng);
    for (float& x : parameters) x *= 3;  // factors that differ
    for (float& x : context) x = static_cast<float>(rng.normal());
  }
  const LatentPosterior& infer(std::size_t rows) {
    encoder.infer(parameters.data(), context.data(), rows, workspace, posterior);
    return posterior;
  }
  ContextEncoder encoder;
  ContextEncoder::Workspace workspace;
  AlignedFloats parameters;
  std::vector<float> context;
  LatentPosterior posterior;
};

// heads of one row in double
std::vector<double> headsOf(const Mlp& network, const std::vector<double>& parameters,
                            const float* row) {
  std::vector<double> x(row, row + network.inputs());
  std::size_t at = 0;
  const std::vector<Block>& blocks = network.blocks();
  for (std::size_t l = 0; l < blocks.size(); l += 2) {
    const std::size_t outputs = blocks[l].shape[0], inputs = blocks[l].shape[1];
    std::vector<double> y(outputs);
    for (std::size_t j = 0; j < outputs; ++j) {
      y[j] = parameters[at + outputs * inputs + j];
      for (std::size_t i = 0; i < inputs; ++i) y[j] += parameters[at + j * inputs + i] * x[i];
      if (l + 2 < blocks.size()) y[j] = std::max(y[j], 0.0);
    }
    at += outputs * (inputs + 1);
    x = y;
  }
  return x;
}

// the product of the factors one after the other: two Gaussians at a time
LatentPosterior productOf(const Encoding& e, const std::vector<double>& parameters,
                          std::size_t rows) {
  LatentPosterior product;
  for (std::size_t i = 0; i < rows; ++i) {
    const auto heads =
        headsOf(e.encoder.network(), parameters, &e.context[i * e.encoder.rowSize()]);
    const std::size_t n = heads.size() / 2;
    for (std::size_t j = 0; j < n; ++j) {
      const double variance = std::log(1 + std::exp(heads[n + j]));
      if (i == 0) {
        product.mean.push_back(heads[j]);
        product.variance.push_back(variance);
        continue;
      }
      double& m = product.mean[j];
      double& v = product.variance[j];
      m = (m * variance + heads[j] * v) / (v + variance);
      v = v * variance / (v + variance);
    }
  }
  return product;
}

TEST(ContextEncoder, PosteriorIsTheProductOfItsFactors) {
  Encoding e;
  const std::vector<double> parameters(e.parameters.begin(), e.parameters.end());
  for (const std::size_t rows : {1, 2, 12}) {
    const LatentPosterior expected = productOf(e, parameters, rows);
    const LatentPosterior& found = e.infer(rows);
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_NEAR(found.mean[j], expected.mean[j], 1e-5);
      EXPECT_NEAR(found.variance[j], expected.variance[j], 1e-5 * expected.variance[j]);
    }
  }
}

TEST(ContextEncoder, EmptyContextGivesThePrior) {
  Encoding e;
  e.infer(12);
  const LatentPosterior& prior = e.infer(0);
  EXPECT_EQ(prior.mean, std::vector<double>(3, 0.0));
  EXPECT_EQ(prior.variance, std::vector<double>(3, 1.0));
  EXPECT_EQ(klToPrior(prior), 0);
}

TEST(ContextEncoder, OrderOfTheContextDoesNotMatter) {
  Encoding e, turned;
  const std::size_t n = e.encoder.rowSize();
  for (std::size_t i = 0; i < 12; ++i) {
    std::copy_n(&e.context[i * n], n, &turned.context[(5 * i + 3) % 12 * n]);
  }
  ASSERT_NE(e.context, turned.context);
  const LatentPosterior &a = e.infer(12), &b = turned.infer(12);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_NEAR(a.mean[j], b.mean[j], 1e-6);
    EXPECT_NEAR(a.variance[j], b.variance[j], 1e-7);
  }
}

TEST(ContextEncoder, LargeContextsAreTakenInPieces) {
  Encoding whole, pieces(smallSettings(), 12, 5);
  const LatentPosterior &a = whole.infer(12), &b = pieces.infer(12);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_NEAR(a.mean[j], b.mean[j], 1e-6);
    EXPECT_NEAR(a.variance[j], b.variance[j], 1e-7);
  }
}

TEST(ContextEncoder, MoreContextMakesItSurer) {
  Encoding e;
  const double one = e.infer(1).variance[0];
  EXPECT_LT(e.infer(12).variance[0], one / 3);
}

TEST(ContextEncoder, VarianceHasAFloor) {
  Encoding e(smallSettings(), 1, 1);
  for (std::size_t k = 0; k < 3; ++k) e.parameters[e.parameters.size() - 1 - k] = -100;
  for (const double variance : e.infer(1).variance) EXPECT_DOUBLE_EQ(variance, 1e-7);
  const double noise[] = {1, 1, 1};
  const float d_z[] = {1, 1, 1};
  std::vector<float> gradient(e.parameters.size());
  e.encoder.backward(e.parameters.data(), e.context.data(), 1, e.posterior, noise, d_z, 0.1,
                     e.workspace, gradient.data());
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(gradient[gradient.size() - 1 - k], 0) << "nothing moves a clamped variance";
    EXPECT_NE(gradient[gradient.size() - 4 - k], 0) << "but the mean";
  }
}

TEST(ContextEncoder, DivergenceAgreesWithNumericalIntegration) {
  const LatentPosterior posterior{{0.7, -1.2}, {0.3, 1.9}};
  double expected = 0;
  for (std::size_t j = 0; j < 2; ++j) {
    const double m = posterior.mean[j], v = posterior.variance[j], step = 1e-3;
    for (double x = m - 10 * std::sqrt(v); x < m + 10 * std::sqrt(v); x += step) {
      const double log_q = -(x - m) * (x - m) / (2 * v) - std::log(2 * M_PI * v) / 2;
      const double log_p = -x * x / 2 - std::log(2 * M_PI) / 2;
      expected += step * std::exp(log_q) * (log_q - log_p);
    }
  }
  EXPECT_NEAR(klToPrior(posterior), expected, 1e-6);
}

TEST(ContextEncoder, GradientAgreesWithCentralDifferences) {
  Encoding e;
  const LatentPosterior posterior = e.infer(12);
  const std::vector<double> noise = {0.4, -1.3, 0.9};
  const std::vector<float> d_z = {1.5f, -0.6f, 0.2f};
  for (const double kl_weight : {0.0, 0.1, 2.0}) {
    std::vector<float> gradient(e.parameters.size());
    e.encoder.backward(e.parameters.data(), e.context.data(), 12, posterior, noise.data(),
                       d_z.data(), kl_weight, e.workspace, gradient.data());
    std::vector<double> zeta(e.parameters.begin(), e.parameters.end());
    const auto loss = [&] {
      const LatentPosterior q = productOf(e, zeta, 12);
      double sum = kl_weight * klToPrior(q);
      for (std::size_t j = 0; j < 3; ++j) {
        sum += d_z[j] * (q.mean[j] + std::sqrt(q.variance[j]) * noise[j]);
      }
      return sum;
    };
    double largest = 0;
    for (const float g : gradient) largest = std::max<double>(largest, std::abs(g));
    ASSERT_GT(largest, 0.01);
    for (std::size_t k = 0; k < zeta.size(); ++k) {
      const double h = 1e-6, at = zeta[k];
      zeta[k] = at + h;
      const double above = loss();
      zeta[k] = at - h;
      const double below = loss();
      zeta[k] = at;
      ASSERT_NEAR(gradient[k], (above - below) / (2 * h), 1e-4 * largest) << k;
    }
  }
}

TEST(ContextEncoder, RowsHoldWhatTheSettingsSay) {
  ContextSettings settings = smallSettings();
  const float s[] = {1, 2}, a[] = {3}, next[] = {4, 5};
  const Transition transition{s, a, 6, 0.9f, next};
  for (const bool with_next : {false, true}) {
    settings.next_observation = with_next;
    const ContextEncoder encoder(2, 1, settings);
    std::vector<float> row(encoder.rowSize());
    encoder.writeRow(transition, row.data());
    EXPECT_EQ(
        row, with_next ? (std::vector<float>{1, 2, 3, 6, 4, 5}) : (std::vector<float>{1, 2, 3, 6}));
  }
}

TEST(ContextEncoder, RowsAreCompressedWhereAskedFor) {
  ContextSettings settings = smallSettings();
  settings.next_observation = settings.symlog = true;
  const float s[] = {50, -0.5f}, a[] = {0}, next[] = {-50, 1};
  const ContextEncoder encoder(2, 1, settings);
  std::vector<float> row(encoder.rowSize());
  encoder.writeRow({s, a, -6, 0.9f, next}, row.data());
  const double expected[] = {std::log(51), -std::log(1.5), 0,
                             -std::log(7), -std::log(51),  std::log(2)};
  ASSERT_EQ(row.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(row[i], expected[i], 1e-6) << i;
}

TEST(ContextEncoder, RefusesAGradientOfMoreThanItHolds) {
  Encoding e(smallSettings(), 12, 5);
  e.infer(12);
  const double noise[3] = {};
  const float d_z[3] = {};
  std::vector<float> gradient(e.parameters.size());
  EXPECT_EQ(test::errorOf([&] {
              e.encoder.backward(e.parameters.data(), e.context.data(), 12, e.posterior, noise, d_z,
                                 0.1, e.workspace, gradient.data());
            }),
            "a context of 12 transitions has no gradient in a workspace of 5: give one that holds "
            "them.");
}

}  // namespace
}  // namespace pmeta
