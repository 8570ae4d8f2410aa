#include "pmeta_core/nn/gru.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "../allocations.h"
#include "../support.h"
#include "baselines/oracle.h"
#include "pmeta_core/base/rng.h"
#include "pmeta_core/nn/initialisation.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

using Batches = std::vector<std::size_t>;

std::vector<float> noise(std::size_t n, std::uint64_t seed, double size = 1) {
  Rng rng(seed, n, Stream::kMeasure);
  std::vector<float> values(n);
  for (float& value : values) value = static_cast<float>(size * rng.normal());
  return values;
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// one unit's sum for gate `gate` (r, z, n): of the inputs and of the hidden state apart
struct Sums {
  double of_input, of_hidden;
};
Sums sumsOf(const Gru& gru, const std::vector<double>& p, std::size_t gate, std::size_t unit,
            const double* x, const double* h) {
  const std::size_t units = gru.units(), row = gate * units + unit;
  const std::size_t hh = 3 * units * gru.inputs(), bias_ih = hh + 3 * units * units;
  Sums sums{p[bias_ih + row], p[bias_ih + 3 * units + row]};
  for (std::size_t i = 0; i < gru.inputs(); ++i) sums.of_input += p[row * gru.inputs() + i] * x[i];
  for (std::size_t i = 0; i < units; ++i) sums.of_hidden += p[hh + row * units + i] * h[i];
  return sums;
}

// hidden states in double, rows as in Gru
std::vector<double> reference(const Gru& gru, const std::vector<double>& p,
                              const std::vector<double>& input, const Batches& batches,
                              std::vector<double> h) {
  const std::size_t units = gru.units();
  std::vector<double> all;
  const double* x = input.data();
  for (const std::size_t batch : batches) {
    for (std::size_t b = 0; b < batch; ++b, x += gru.inputs()) {
      const std::vector<double> before(&h[b * units], &h[b * units] + units);
      for (std::size_t u = 0; u < units; ++u) {
        const Sums r = sumsOf(gru, p, 0, u, x, before.data());
        const Sums z = sumsOf(gru, p, 1, u, x, before.data());
        const Sums n = sumsOf(gru, p, 2, u, x, before.data());
        const double keep = sigmoid(z.of_input + z.of_hidden);
        const double fresh =
            std::tanh(n.of_input + sigmoid(r.of_input + r.of_hidden) * n.of_hidden);
        h[b * units + u] = (1 - keep) * fresh + keep * before[u];
      }
      all.insert(all.end(), &h[b * units], &h[b * units] + units);
    }
  }
  return all;
}

template <class Function>
double centralDifference(std::vector<double>& x, std::size_t k, Function&& function) {
  const double h = 1e-6, at = x[k];
  x[k] = at + h;
  const double above = function();
  x[k] = at - h;
  const double below = function();
  x[k] = at;
  return (above - below) / (2 * h);
}

struct Shape {
  GruSpec spec;
  Batches batches;
};

class GruOf : public ::testing::TestWithParam<Shape> {
 protected:
  void TearDown() override { setKernels(kernelNames().front()); }
};
INSTANTIATE_TEST_SUITE_P(Shapes, GruOf,
                         ::testing::Values(Shape{{"gru", 3, 5}, {1, 1, 1, 1}},
                                           Shape{{"gru", 4, 18}, {5, 5, 3, 3, 1}},
                                           Shape{{"gru", 4, 7, true}, {4, 4, 2}}),
                         [](const auto& test) { return "Number" + std::to_string(test.index); });

TEST_P(GruOf, GradientsThroughTimeAgreeWithCentralDifferencesOfTheDoubleReference) {
  const auto& [spec, batches] = GetParam();
  const Gru gru(spec);
  std::size_t rows = 0;
  for (const std::size_t batch : batches) rows += batch;
  const auto parameters = noise(gru.size(), 1, 0.4), input = noise(rows * gru.inputs(), 2);
  const auto initial = noise(batches.front() * gru.units(), 3, 0.5);
  const auto direction = noise(rows * gru.units(), 4);
  std::vector<double> p(parameters.begin(), parameters.end()), x(input.begin(), input.end());
  std::vector<double> h(initial.begin(), initial.end());
  const auto loss = [&, batches = batches] {
    const auto hidden = reference(gru, p, x, batches, h);
    double sum = 0;
    for (std::size_t k = 0; k < hidden.size(); ++k) sum += hidden[k] * direction[k];
    return sum;
  };

  GruWorkspace workspace(gru, rows, batches.front());
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    const auto exact = reference(gru, p, x, batches, h);
    const float* hidden =
        gru.unroll(parameters.data(), input.data(), batches, initial.data(), workspace);
    for (std::size_t k = 0; k < exact.size(); ++k) ASSERT_NEAR(hidden[k], exact[k], 2e-6) << name;

    std::vector<float> gradient(gru.size(), -99), d_input(x.size(), -99), d_initial(h.size(), -99);
    gru.backward(parameters.data(), input.data(), direction.data(), gradient.data(), d_input.data(),
                 d_initial.data(), workspace);
    for (std::size_t k = 0; k < p.size(); ++k) {
      ASSERT_NEAR(gradient[k], centralDifference(p, k, loss), 2e-5) << name << " parameter " << k;
    }
    for (std::size_t k = 0; k < x.size(); ++k) {
      ASSERT_NEAR(d_input[k], centralDifference(x, k, loss), 2e-5) << name << " input " << k;
    }
    for (std::size_t k = 0; k < h.size(); ++k) {
      ASSERT_NEAR(d_initial[k], centralDifference(h, k, loss), 2e-5) << name << " initial " << k;
    }
  }
}

TEST_P(GruOf, StepsAreTheUnroll) {
  const auto& [spec, batches] = GetParam();
  const Gru gru(spec);
  const std::size_t batch = batches.front(), units = gru.units();
  const auto parameters = noise(gru.size(), 1, 0.4), input = noise(3 * batch * gru.inputs(), 2);
  GruWorkspace all(gru, 3 * batch, batch), one(gru, batch, batch);
  const float* hidden =
      gru.unroll(parameters.data(), input.data(), {batch, batch, batch}, nullptr, all);
  std::vector<float> state(batch * units);
  for (std::size_t t = 0; t < 3; ++t) {
    gru.step(parameters.data(), &input[t * batch * gru.inputs()], batch, state.data(), one);
    for (std::size_t k = 0; k < state.size(); ++k) {
      ASSERT_NEAR(state[k], hidden[t * batch * units + k], 1e-6);
    }
  }
}

TEST(Gru, HiddenStatesAgreeWithTheOracle) {
  const auto oracle = test::loadOracle("rl2_oracle.json");
  const Gru gru({"gru", oracle["inputs"], oracle["hidden"]});
  const auto parameters = oracle["theta_old"].get<std::vector<float>>();
  const std::size_t trials = oracle["trials"], steps = oracle["steps"];
  std::vector<float> input;
  for (std::size_t t = 0; t < steps; ++t) {
    for (std::size_t b = 0; b < trials; ++b) {
      for (const float x : oracle["x"][b][t]) input.push_back(x);
    }
  }
  GruWorkspace workspace(gru, trials * steps, trials);
  const float* hidden =
      gru.unroll(parameters.data(), input.data(), Batches(steps, trials), nullptr, workspace);
  for (std::size_t t = 0; t < steps; ++t) {
    for (std::size_t b = 0; b < trials; ++b) {
      for (const double h : oracle["hidden_states_theta_old"][b][t]) {
        EXPECT_NEAR(*hidden++, h, 1e-6);
      }
    }
  }
}

TEST(Gru, AllocatesNothingInAnUnroll) {
  const Gru gru({"gru", 4, 16, true});
  const auto parameters = noise(gru.size(), 1), input = noise(9 * 4, 2),
             d_hidden = noise(9 * 16, 3);
  const Batches batches = {4, 3, 2};
  std::vector<float> gradient(gru.size());
  GruWorkspace workspace(gru, 9, 4);
  const std::size_t before = test::allocations();
  gru.unroll(parameters.data(), input.data(), batches, nullptr, workspace);
  gru.backward(parameters.data(), input.data(), d_hidden.data(), gradient.data(), nullptr, nullptr,
               workspace);
  EXPECT_EQ(test::allocations(), before);
}

TEST(Gru, BlocksAreNamedAsInPyTorch) {
  const Gru gru({"gru", 7, 4});
  std::vector<std::string> names;
  for (const Block& block : gru.blocks()) names.push_back(block.name);
  EXPECT_EQ(names, (std::vector<std::string>{"gru.weight_ih", "gru.weight_hh", "gru.bias_ih",
                                             "gru.bias_hh"}));
  EXPECT_EQ(gru.size(), 3u * 4 * (7 + 4 + 2));
}

TEST(Gru, RefusesWhatDoesNotFit) {
  const Gru gru({"gru", 2, 3});
  GruWorkspace workspace(gru, 4, 2);
  const auto parameters = noise(gru.size(), 1), input = noise(16, 2);
  const auto unroll = [&](const Batches& batches) {
    return test::errorOf(
        [&] { gru.unroll(parameters.data(), input.data(), batches, nullptr, workspace); });
  };
  EXPECT_EQ(unroll({2, 2}), "(no error)");
  for (const Batches& batches : {Batches{}, {0}, {3}, {2, 2, 1}}) {
    EXPECT_NE(unroll(batches).find("room for 2 sequences and 4 steps"), std::string::npos);
  }
  EXPECT_NE(unroll({1, 2}).find("longest first"), std::string::npos);
  std::vector<float> hidden(9);
  EXPECT_THROW(gru.step(parameters.data(), input.data(), 3, hidden.data(), workspace), Error);
  EXPECT_THROW(Gru({"gru", 0, 3}), Error);
  EXPECT_THROW(Gru({"gru", 3, 0}), Error);
  EXPECT_THROW(Gru({"", 3, 3}), Error);
  EXPECT_THROW(GruWorkspace(gru, 1, 2), Error);
}

TEST(Initialisation, OrthogonalMatricesAreAndVectorsAreZero) {
  for (const auto& [rows, columns] : {std::pair<std::size_t, std::size_t>{24, 8}, {3, 17}}) {
    std::vector<float> w(rows * columns + 5, 99);
    Rng rng(1, 0, Stream::kInitialise);
    initialise({{"w", {rows, columns}}, {"b", {5}}}, Initialisation::kOrthogonal, w.data(), rng);
    const bool wide = rows <= columns;
    const std::size_t count = std::min(rows, columns), length = std::max(rows, columns);
    const auto at = [&, rows = rows, columns = columns](std::size_t k, std::size_t j) {
      return wide ? w[k * columns + j] : w[j * columns + k];
    };
    for (std::size_t a = 0; a < count; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        double product = 0;
        for (std::size_t j = 0; j < length; ++j) product += at(a, j) * at(b, j);
        EXPECT_NEAR(product, a == b ? 1 : 0, 1e-6);
      }
    }
    for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(w[rows * columns + k], 0);
  }
}

TEST(Initialisation, GlorotFillsItsInterval) {
  std::vector<float> w(200 * 40, 99);
  Rng rng(1, 0, Stream::kInitialise);
  initialise({{"w", {200, 40}}}, Initialisation::kGlorot, w.data(), rng);
  const auto [low, high] = std::minmax_element(w.begin(), w.end());
  EXPECT_NEAR(*low, -std::sqrt(6.0 / 240), 1e-3);
  EXPECT_NEAR(*high, std::sqrt(6.0 / 240), 1e-3);
}

}  // namespace
}  // namespace pmeta
