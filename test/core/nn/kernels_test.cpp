#include "pmeta_core/nn/kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/base/rng.h"

namespace pmeta {
namespace {

// puts the machine's own choice back
class KernelsTest : public ::testing::Test {
 protected:
  void TearDown() override { setKernels(kernelNames().front()); }
};

std::vector<float> noise(std::size_t n, std::uint64_t seed, double size = 1) {
  Rng rng(seed, n, Stream::kMeasure);
  std::vector<float> values(n);
  for (float& value : values) value = static_cast<float>(size * (2 * rng.uniform() - 1));
  return values;
}

// what every table must give, bit for bit, when asked to `compute`
template <class Compute>
void expectSameBits(Compute&& compute) {
  setKernels("default");
  const std::vector<float> expected = compute(kernels());
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    const std::vector<float> found = compute(kernels());
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_EQ(0, std::memcmp(found.data(), expected.data(), found.size() * sizeof(float))) << name;
  }
}

TEST_F(KernelsTest, NamesEndInDefaultAndOthersAreRefused) {
  ASSERT_FALSE(kernelNames().empty());
  EXPECT_EQ(kernelNames().back(), "default");
  EXPECT_EQ(kernels().name, kernelNames().front());
  const std::string error = test::errorOf([] { setKernels("mmx"); });
  EXPECT_NE(error.find("'mmx'"), std::string::npos) << error;
  EXPECT_NE(error.find("default"), std::string::npos) << error;
}

TEST_F(KernelsTest, BiasAndRelu) {
  const std::vector<float> x = {-3, 2, 5, 1, -1, -7}, bias = {1, -2, 0.5f};
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    std::vector<float> y = x;
    kernels().addBias(y.data(), bias.data(), 2, 3);
    EXPECT_EQ(y, (std::vector<float>{-2, 0, 5.5f, 2, -3, -6.5f}));
    y = x;
    kernels().addBiasRelu(y.data(), bias.data(), 2, 3);
    EXPECT_EQ(y, (std::vector<float>{0, 0, 5.5f, 2, 0, 0}));
  }
}

TEST_F(KernelsTest, MaskLetsThroughWhereTheUnitIsActive) {
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    std::vector<float> d = {1, 2, 3, -4, 5};
    const std::vector<float> activation = {0.5f, 0, 1e-30f, 2, 0};
    kernels().maskRelu(d.data(), activation.data(), 5);
    EXPECT_EQ(d, (std::vector<float>{1, 0, 3, -4, 0}));
  }
}

TEST_F(KernelsTest, ReluDoesNotHideNaN) {
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    std::vector<float> y(40, std::numeric_limits<float>::quiet_NaN());
    const std::vector<float> bias(40);
    kernels().addBiasRelu(y.data(), bias.data(), 1, 40);
    for (const float one : y) EXPECT_TRUE(std::isnan(one)) << name;
  }
}

TEST_F(KernelsTest, ColumnSumsAgreeWithDouble) {
  for (const std::size_t columns : {1, 2, 15, 64, 131}) {
    const std::size_t rows = 64;
    const auto x = noise(rows * columns, 1);
    expectSameBits([&](const Kernels& kernel) {
      std::vector<float> sums(columns, -1);
      kernel.columnSums(x.data(), sums.data(), rows, columns);
      for (std::size_t c = 0; c < columns; ++c) {
        double sum = 0;
        for (std::size_t r = 0; r < rows; ++r) sum += x[r * columns + c];
        EXPECT_NEAR(sums[c], sum, 1e-5);
      }
      return sums;
    });
  }
}

TEST_F(KernelsTest, AffineAgreesWithDouble) {
  for (const std::size_t inputs : {1, 4, 15, 16, 33, 512}) {
    for (const std::size_t outputs : {1, 3, 4, 9}) {
      for (const bool relu : {false, true}) {
        const std::size_t rows = 3;
        const auto x = noise(rows * inputs, 1), w = noise(inputs * outputs, 2);
        const auto bias = noise(outputs, 3);
        expectSameBits([&](const Kernels& kernel) {
          std::vector<float> y(rows * outputs);
          kernel.affine(x.data(), w.data(), bias.data(), y.data(), rows, inputs, outputs, relu);
          for (std::size_t k = 0; k < y.size(); ++k) {
            double sum = bias[k % outputs];
            for (std::size_t i = 0; i < inputs; ++i) {
              sum += double(x[k / outputs * inputs + i]) * w[k % outputs * inputs + i];
            }
            EXPECT_NEAR(y[k], relu ? std::max(sum, 0.0) : sum, 2e-5);
          }
          return y;
        });
      }
    }
  }
}

// mean_k w_k h(e_k) in double
double lossOf(const std::vector<double>& error, const std::vector<float>& weight, double delta) {
  double sum = 0;
  for (std::size_t k = 0; k < error.size(); ++k) {
    const double size = std::abs(error[k]);
    const double loss = delta == 0      ? size * size
                        : size <= delta ? size * size / 2
                                        : delta * (size - delta / 2);
    sum += (weight.empty() ? 1 : weight[k]) * loss;
  }
  return sum / static_cast<double>(error.size());
}

TEST_F(KernelsTest, LossGradientsAgreeWithCentralDifferences) {
  const std::size_t n = 37;
  const auto error = noise(n, 4, 3);
  for (const bool weighted : {false, true}) {
    std::vector<float> weight;
    if (weighted) weight = noise(n, 5);
    for (const double delta : {0.0, 1.0, 0.3}) {  // 0: the squared loss
      expectSameBits([&](const Kernels& kernel) {
        std::vector<float> result(n + 1);
        const float* w = weighted ? weight.data() : nullptr;
        result[n] = delta == 0 ? kernel.squaredLoss(error.data(), w, result.data(), n)
                               : kernel.huberLoss(error.data(), w, static_cast<float>(delta),
                                                  result.data(), n);
        std::vector<double> e(error.begin(), error.end());
        EXPECT_NEAR(result[n], lossOf(e, weight, delta), 1e-6);
        for (std::size_t k = 0; k < n; ++k) {
          const double h = 1e-5, at = e[k];
          e[k] = at + h;
          const double above = lossOf(e, weight, delta);
          e[k] = at - h;
          const double below = lossOf(e, weight, delta);
          e[k] = at;
          EXPECT_NEAR(result[k], (above - below) / (2 * h), 1e-7) << k;
        }
        return result;
      });
    }
  }
}

TEST_F(KernelsTest, AdamGivesTheSameBitsOnEveryInstructionSetAtAnyAlignment) {
  for (const std::size_t n : {1, 15, 16, 100, 1003}) {
    for (int variant = 0; variant < 6; ++variant) {
      expectSameBits([&](const Kernels& kernel) {
        // phi, m, v, omega and target, each one float off any alignment
        std::vector<std::vector<float>> state;
        for (std::uint64_t i = 0; i < 5; ++i) state.push_back(noise(n + 1, i));
        for (float& v : state[2]) v = std::abs(v);
        const auto gradient = noise(n + 1, 9);
        AdamPass pass;
        pass.step_size = 0.01f;
        pass.one_minus_beta1 = 0.1f;
        pass.one_minus_beta2 = 0.001f;
        pass.root_correction = 1.5f;
        pass.pull = 0.02f;
        pass.follow = 0.2f;
        pass.coupled = variant % 3 == 2;
        pass.tau = 0.005f;
        kernel.adam(pass, &state[0][1], &state[1][1], &state[2][1], &gradient[1],
                    variant % 3 > 0 ? &state[3][1] : nullptr, variant > 2 ? &state[4][1] : nullptr,
                    n);
        std::vector<float> all;
        for (const auto& one : state) all.insert(all.end(), one.begin(), one.end());
        return all;
      });
    }
  }
}

TEST_F(KernelsTest, TanhGaussianAgreesWithDouble) {
  for (const std::size_t n : {1, 15, 16, 100, 3003}) {
    const auto mean = noise(n, 1, 12), log_std = noise(n, 2, 8), e = noise(n, 3, 3);
    expectSameBits([&](const Kernels& kernel) {
      std::vector<float> action(n), deviation(n), log_density(n);
      kernel.tanhGaussian(mean.data(), log_std.data(), e.data(), -5, 2, action.data(),
                          deviation.data(), log_density.data(), n);
      for (std::size_t k = 0; k < n; ++k) {
        const double l = std::min(std::max<double>(log_std[k], -5), 2.0);
        const double d = std::exp(l) * e[k], u = mean[k] + d, size = std::abs(u);
        const double log_slope = 2 * (std::log(2) - size - std::log1p(std::exp(-2 * size)));
        const double expected = -0.5 * e[k] * e[k] - l - 0.5 * std::log(2 * M_PI) - log_slope;
        EXPECT_NEAR(action[k], std::tanh(u), 1e-6) << u;
        EXPECT_NEAR(deviation[k], d, 3e-7 * std::abs(d)) << l;
        EXPECT_NEAR(log_density[k], expected, 1e-6 * (4 + 2 * size)) << u;
      }
      std::vector<float> all = action;
      all.insert(all.end(), deviation.begin(), deviation.end());
      all.insert(all.end(), log_density.begin(), log_density.end());
      return all;
    });
  }
}

TEST_F(KernelsTest, TanhGaussianOfTheEndsOfTheRange) {
  const std::vector<float> mean = {200, -200,  1e30f,
                                   0,   1e-6f, std::numeric_limits<float>::quiet_NaN()};
  const std::vector<float> log_std(6, -50), e(6);
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    std::vector<float> action(6), deviation(6), log_density(6);
    kernels().tanhGaussian(mean.data(), log_std.data(), e.data(), -5, 2, action.data(),
                           deviation.data(), log_density.data(), 6);
    EXPECT_EQ(action[0], 1);
    EXPECT_EQ(action[1], -1);
    EXPECT_EQ(action[2], 1);
    EXPECT_EQ(action[3], 0);
    EXPECT_NEAR(action[4], 1e-6, 1e-7);
    EXPECT_TRUE(std::isnan(action[5])) << "divergence shows";
    EXPECT_NEAR(log_density[0], 5 - 0.5 * std::log(2 * M_PI) - 2 * (std::log(2) - 200), 1e-3);
    EXPECT_TRUE(std::isfinite(log_density[2]));
  }
}

TEST_F(KernelsTest, TanhAndItsSlopeAgreeWithDouble) {
  const std::size_t n = 1003;
  const auto x = noise(n, 1, 12), d = noise(n, 2);
  expectSameBits([&](const Kernels& kernel) {
    std::vector<float> y = x, slope = d;
    kernel.hyperbolicTangent(y.data(), n);
    kernel.scaleByTanhSlope(slope.data(), y.data(), n);
    for (std::size_t k = 0; k < n; ++k) {
      const double t = std::tanh(double(x[k]));
      EXPECT_NEAR(y[k], t, 3e-7) << x[k];
      EXPECT_NEAR(slope[k], d[k] * (1 - t * t), 1e-6) << x[k];
    }
    y.insert(y.end(), slope.begin(), slope.end());
    return y;
  });
}

TEST_F(KernelsTest, GruOfTheEndsOfTheRange) {
  // gates wide open or shut, in either way, and a number that is none
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> recurrent(3), previous = {0.5f};
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    float next = 0;
    std::vector<float> keeps = {-1e30f, 1e30f, 1e30f, 0}, takes = {-1e30f, 1e30f, -1e30f, 0};
    std::vector<float> broken = {0, nan, 0, 0};
    kernels().gruForward(keeps.data(), recurrent.data(), previous.data(), &next, 1, 1);
    EXPECT_EQ(next, 0.5f) << name;
    kernels().gruForward(takes.data(), recurrent.data(), previous.data(), &next, 1, 1);
    EXPECT_EQ(next, -1) << name;
    kernels().gruForward(broken.data(), recurrent.data(), previous.data(), &next, 1, 1);
    EXPECT_TRUE(std::isnan(next)) << "divergence shows";
  }
}

}  // namespace
}  // namespace pmeta
