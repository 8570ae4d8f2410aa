#include "pmeta_core/nn/mlp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

std::vector<float> noise(std::size_t n, std::uint64_t seed) {
  Rng rng(seed, n, Stream::kMeasure);
  std::vector<float> values(n);
  for (float& value : values) value = static_cast<float>(rng.normal());
  return values;
}

std::vector<float> initialised(const Mlp& mlp, std::uint64_t seed) {
  std::vector<float> parameters(mlp.size());
  Rng rng(seed, 0, Stream::kInitialise);
  mlp.initialise(parameters.data(), rng);
  return parameters;
}

// the values of the block `name` within the flat parameters
const double* find(const Mlp& mlp, const std::vector<double>& parameters, const std::string& name) {
  std::size_t offset = 0;
  for (const Block& block : mlp.blocks()) {
    if (block.name == mlp.spec().prefix + "." + name) return &parameters[offset];
    offset += block.size();
  }
  ADD_FAILURE() << "no block " << name;
  return nullptr;
}

std::vector<double> linear(const Mlp& mlp, const std::vector<double>& parameters,
                           const std::string& name, const std::vector<double>& x, std::size_t out) {
  const double* weight = find(mlp, parameters, name + ".weight");
  const double* bias = find(mlp, parameters, name + ".bias");
  std::vector<double> y(bias, bias + out);
  for (std::size_t o = 0; o < out; ++o) {
    for (std::size_t i = 0; i < x.size(); ++i) y[o] += weight[o * x.size() + i] * x[i];
  }
  return y;
}

// one sample in double, by the blocks' names
std::vector<double> reference(const Mlp& mlp, const std::vector<double>& parameters,
                              const std::vector<double>& input) {
  const MlpSpec& spec = mlp.spec();
  std::vector<double> x = input;
  std::size_t l = 0;
  for (; l < spec.hidden.size(); ++l) {
    x = linear(mlp, parameters, "layer" + std::to_string(l), x, spec.hidden[l]);
    const bool relu = spec.activation == Activation::kRelu;
    for (double& unit : x) unit = relu ? std::max(unit, 0.0) : std::tanh(unit);
  }
  if (!spec.dueling) {
    const std::string last = "layer" + std::to_string(l);
    const auto heads = linear(mlp, parameters, last, x, spec.heads * spec.outputs);
    if (spec.heads == 1) return heads;
    std::vector<double> sum(spec.outputs);
    for (std::size_t k = 0; k < heads.size(); ++k) {
      sum[k % spec.outputs] += input[spec.head_input + k / spec.outputs] * heads[k];
    }
    return sum;
  }
  const double value = linear(mlp, parameters, "value", x, 1)[0];
  std::vector<double> q = linear(mlp, parameters, "advantage", x, spec.outputs);
  double mean = 0;
  for (const double a : q) mean += a / static_cast<double>(q.size());
  for (double& a : q) a += value - mean;
  return q;
}

// sum over batch and outputs of output * direction, so that `direction` is its gradient
double project(const Mlp& mlp, const std::vector<double>& parameters,
               const std::vector<double>& input, const std::vector<float>& direction) {
  double sum = 0;
  for (std::size_t b = 0; b * mlp.inputs() < input.size(); ++b) {
    const auto begin = input.begin() + static_cast<std::ptrdiff_t>(b * mlp.inputs());
    const auto y =
        reference(mlp, parameters, {begin, begin + static_cast<std::ptrdiff_t>(mlp.inputs())});
    for (std::size_t o = 0; o < y.size(); ++o) sum += y[o] * direction[b * y.size() + o];
  }
  return sum;
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
  MlpSpec spec;
  std::size_t batch;
};

class MlpOf : public ::testing::TestWithParam<Shape> {};
INSTANTIATE_TEST_SUITE_P(
    Shapes, MlpOf,
    ::testing::Values(Shape{{"q", 4, {13, 10}, 2}, 9}, Shape{{"q", 5, {17, 12}, 3, true}, 6},
                      Shape{{"q", 3, {}, 2}, 4}, Shape{{"q", 3, {}, 2, true}, 1},
                      Shape{{"critic1", 7, {20}, 1}, 12}, Shape{{"pi", 6, {9, 8, 11}, 10}, 5},
                      Shape{{"pi", 6, {9}, 4, true}, 1},
                      Shape{{"pi", 6, {9, 12}, 4, false, false, Activation::kTanh}, 5},
                      Shape{{"pi", 6, {9}, 4, false, false, Activation::kRelu, 3, 2}, 5},
                      Shape{{"q", 5, {}, 1, false, false, Activation::kRelu, 2, 0}, 3}),
    [](const auto& test) { return "Number" + std::to_string(test.index); });

TEST_P(MlpOf, ForwardAgreesWithDoubleOnEveryInstructionSet) {
  const auto& [spec, batch] = GetParam();
  const Mlp mlp(spec);
  const auto parameters = initialised(mlp, 1), input = noise(batch * spec.inputs, 2);
  const std::vector<double> exact(parameters.begin(), parameters.end());
  MlpWorkspace workspace(mlp, batch);
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    const float* y = mlp.forward(parameters.data(), input.data(), batch, workspace);
    for (std::size_t b = 0; b < batch; ++b) {
      const auto* x = &input[b * spec.inputs];
      const auto expected = reference(mlp, exact, {x, x + spec.inputs});
      for (std::size_t o = 0; o < spec.outputs; ++o) {
        EXPECT_NEAR(y[b * spec.outputs + o], expected[o], 3e-6) << name;
      }
    }
  }
  setKernels(kernelNames().front());
}

TEST_P(MlpOf, GradientsAgreeWithCentralDifferencesOfTheDoubleReference) {
  const auto& [spec, batch] = GetParam();
  const Mlp mlp(spec);
  const auto parameters = initialised(mlp, 1), input = noise(batch * spec.inputs, 2);
  const auto direction = noise(batch * spec.outputs, 3);
  std::vector<double> p(parameters.begin(), parameters.end()), x(input.begin(), input.end());
  const auto loss = [&, spec = spec] { return project(mlp, p, x, direction); };

  MlpWorkspace workspace(mlp, batch);
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    std::vector<float> gradient(mlp.size(), -99), d_input(input.size(), -99);
    mlp.forward(parameters.data(), input.data(), batch, workspace);
    mlp.backward(parameters.data(), input.data(), batch, direction.data(), gradient.data(),
                 d_input.data(), workspace);
    for (std::size_t k = 0; k < p.size(); ++k) {
      ASSERT_NEAR(gradient[k], centralDifference(p, k, loss), 1e-5) << name << " parameter " << k;
    }
    for (std::size_t k = 0; k < x.size(); ++k) {
      ASSERT_NEAR(d_input[k], centralDifference(x, k, loss), 1e-5) << name << " input " << k;
    }
  }
  setKernels(kernelNames().front());
}

TEST_P(MlpOf, FrozenBackwardGivesTheSameInputGradient) {
  const auto& [spec, batch] = GetParam();
  const Mlp mlp(spec);
  const auto parameters = initialised(mlp, 1), input = noise(batch * spec.inputs, 2);
  const auto direction = noise(batch * spec.outputs, 3);
  MlpWorkspace workspace(mlp, batch);
  std::vector<float> gradient(mlp.size()), d_input(input.size()), d_part(batch * 2);
  mlp.forward(parameters.data(), input.data(), batch, workspace);
  mlp.backward(parameters.data(), input.data(), batch, direction.data(), gradient.data(),
               d_input.data(), workspace);
  mlp.backwardInput(parameters.data(), batch, direction.data(), 1, 2, d_part.data(), workspace);
  for (std::size_t k = 0; k < d_part.size(); ++k) {
    EXPECT_NEAR(d_part[k], d_input[k / 2 * spec.inputs + 1 + k % 2], 1e-6);
  }
}

TEST(Mlp, LossOfOneUpdateHasTheRightGradient) {
  // weighted squared TD error of the actions taken, through the dueling heads
  const std::size_t batch = 8;
  const Mlp mlp({"q", 4, {12, 9}, 3, true});
  const auto parameters = initialised(mlp, 4), input = noise(batch * 4, 5);
  const auto goal = noise(batch, 6), weight = noise(batch, 7);
  std::vector<double> p(parameters.begin(), parameters.end());
  const auto loss = [&] {
    double sum = 0;
    for (std::size_t b = 0; b < batch; ++b) {
      const auto q = reference(mlp, p, {&input[4 * b], &input[4 * b] + 4});
      sum += weight[b] * std::pow(q[b % 3] - goal[b], 2) / batch;
    }
    return sum;
  };

  MlpWorkspace workspace(mlp, batch);
  const float* q = mlp.forward(parameters.data(), input.data(), batch, workspace);
  std::vector<float> error(batch), d_error(batch), d_q(batch * 3), gradient(mlp.size());
  for (std::size_t b = 0; b < batch; ++b) error[b] = q[3 * b + b % 3] - goal[b];
  EXPECT_NEAR(kernels().squaredLoss(error.data(), weight.data(), d_error.data(), batch), loss(),
              1e-5);
  for (std::size_t b = 0; b < batch; ++b) d_q[3 * b + b % 3] = d_error[b];
  mlp.backward(parameters.data(), input.data(), batch, d_q.data(), gradient.data(), nullptr,
               workspace);
  for (std::size_t k = 0; k < p.size(); ++k) {
    ASSERT_NEAR(gradient[k], centralDifference(p, k, loss), 1e-5) << k;
  }
}

TEST(Mlp, BatchesOfAnySizeAgree) {
  // few rows take another way than many
  const Mlp mlp({"q", 4, {64, 64}, 12});
  const auto parameters = initialised(mlp, 1), input = noise(32 * 4, 2);
  MlpWorkspace all(mlp, 32), one(mlp, 1);
  const float* together = mlp.forward(parameters.data(), input.data(), 32, all);
  for (std::size_t b = 0; b < 32; ++b) {
    const float* alone = mlp.forward(parameters.data(), &input[4 * b], 1, one);
    for (std::size_t o = 0; o < 12; ++o) EXPECT_NEAR(alone[o], together[12 * b + o], 2e-6);
  }
}

TEST(Mlp, BackwardOfChosenRowsIsThatOfTheWhole) {
  const Mlp mlp({"q", 5, {24, 17}, 1});
  const auto parameters = initialised(mlp, 1), input = noise(40 * 5, 2), d_q = noise(40, 3);
  MlpWorkspace workspace(mlp, 40);
  mlp.forward(parameters.data(), input.data(), 40, workspace);
  std::vector<float> whole(40 * 2), some(3 * 2);
  mlp.backwardInput(parameters.data(), 40, d_q.data(), 1, 2, whole.data(), workspace);
  const std::vector<std::size_t> rows = {3, 17, 39};
  const std::vector<float> d_rows = {d_q[3], d_q[17], d_q[39]};
  mlp.backwardInput(parameters.data(), 3, d_rows.data(), 1, 2, some.data(), workspace, rows.data());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t c = 0; c < 2; ++c) EXPECT_NEAR(some[2 * i + c], whole[2 * rows[i] + c], 1e-6);
  }
}

TEST(Mlp, BackwardOfTheFirstRowsIsThatOfASmallerBatch) {
  const Mlp mlp({"q", 5, {24, 17}, 3});
  const auto parameters = initialised(mlp, 1), input = noise(40 * 5, 2), d_y = noise(10 * 3, 3);
  MlpWorkspace large(mlp, 40), small(mlp, 10);
  mlp.forward(parameters.data(), input.data(), 40, large);
  mlp.forward(parameters.data(), input.data(), 10, small);
  std::vector<float> a(mlp.size()), b(mlp.size());
  mlp.backward(parameters.data(), input.data(), 10, d_y.data(), a.data(), nullptr, large);
  mlp.backward(parameters.data(), input.data(), 10, d_y.data(), b.data(), nullptr, small);
  for (std::size_t k = 0; k < a.size(); ++k) ASSERT_NEAR(a[k], b[k], 1e-5);
}

TEST(Mlp, BackwardBySomeInputsIsThatPartOfAll) {
  for (const std::vector<std::size_t>& hidden : {std::vector<std::size_t>{24, 17}, {}}) {
    const Mlp mlp({"q", 5, hidden, 2});
    const auto parameters = initialised(mlp, 1), input = noise(30 * 5, 2), d_y = noise(30 * 2, 3);
    MlpWorkspace workspace(mlp, 30);
    mlp.forward(parameters.data(), input.data(), 30, workspace);
    std::vector<float> gradient(mlp.size()), same(mlp.size()), all(30 * 5), some(30 * 3);
    mlp.backward(parameters.data(), input.data(), 30, d_y.data(), gradient.data(), all.data(),
                 workspace);
    mlp.backward(parameters.data(), input.data(), 30, d_y.data(), same.data(), 1, 3, some.data(),
                 workspace);
    EXPECT_EQ(same, gradient);
    for (std::size_t b = 0; b < 30; ++b) {
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(some[3 * b + i], all[5 * b + 1 + i], 1e-6);
    }
    EXPECT_THROW(mlp.backward(parameters.data(), input.data(), 30, d_y.data(), same.data(), 3, 3,
                              some.data(), workspace),
                 Error);
  }
}

TEST(Mlp, BlocksAreNamedAsInPyTorch) {
  const Mlp plain({"q", 4, {8, 6}, 2}), dueling({"q", 4, {8}, 2, true});
  EXPECT_EQ(ModelLayout(Precision::kFloat32, plain.blocks()).text(),
            "float32\nq.layer0.weight 8 4\nq.layer0.bias 8\nq.layer1.weight 6 8\nq.layer1.bias 6\n"
            "q.layer2.weight 2 6\nq.layer2.bias 2\n");
  EXPECT_EQ(ModelLayout(Precision::kFloat32, dueling.blocks()).text(),
            "float32\nq.layer0.weight 8 4\nq.layer0.bias 8\nq.value.weight 1 8\n"
            "q.advantage.weight 2 8\nq.value.bias 1\nq.advantage.bias 2\n");
  EXPECT_EQ(plain.size(), 8u * 4 + 8 + 6 * 8 + 6 + 2 * 6 + 2);
  EXPECT_EQ(dueling.size(), 8u * 4 + 8 + 3 * 8 + 3);
}

TEST(Mlp, AOneHotVectorChoosesItsHead) {
  const Mlp three({"pi", 5, {8}, 2, false, false, Activation::kRelu, 3, 1});
  const Mlp one({"pi", 5, {8}, 2});
  const auto parameters = initialised(three, 1);
  const std::vector<float> input = {0.3f, 0, 1, 0, -0.7f};
  MlpWorkspace of_three(three, 1), of_one(one, 1);
  const float* y = three.forward(parameters.data(), input.data(), 1, of_three);
  // the hidden layer, then the weights and the biases of head 1
  std::vector<float> chosen(parameters.begin(), parameters.begin() + 8 * 5 + 8);
  const auto append = [&](std::size_t begin, std::size_t count) {
    const auto from = parameters.begin() + static_cast<std::ptrdiff_t>(begin);
    chosen.insert(chosen.end(), from, from + static_cast<std::ptrdiff_t>(count));
  };
  append(48 + 2 * 8, 2 * 8);
  append(48 + 6 * 8 + 2, 2);
  const float* expected = one.forward(chosen.data(), input.data(), 1, of_one);
  for (std::size_t o = 0; o < 2; ++o) EXPECT_FLOAT_EQ(y[o], expected[o]);
}

TEST(Mlp, InitialisesUniformlyWithinTorchsBounds) {
  const Mlp mlp({"q", 4, {400, 100}, 2});
  const auto parameters = initialised(mlp, 3);
  std::size_t offset = 0, inputs = 0;
  for (const Block& block : mlp.blocks()) {
    // a bias follows the weight of its layer, whose inputs bound both
    if (block.shape.size() == 2) inputs = block.shape[1];
    const double bound = 1 / std::sqrt(static_cast<double>(inputs));
    double most = 0, sum = 0, squares = 0;
    for (std::size_t k = 0; k < block.size(); ++k) {
      const double x = parameters[offset + k];
      most = std::max(most, std::abs(x));
      sum += x;
      squares += x * x;
    }
    const auto n = static_cast<double>(block.size());
    EXPECT_LE(most, bound * (1 + 1e-6)) << block.name;
    EXPECT_LT(std::abs(sum / n), 5 * bound / std::sqrt(3 * n)) << block.name;
    if (n > 1000) {
      EXPECT_NEAR(squares / n, bound * bound / 3, 0.05 * bound * bound) << block.name;
    }
    offset += block.size();
  }
  EXPECT_EQ(initialised(mlp, 3), parameters);
  EXPECT_NE(initialised(mlp, 4), parameters);
}

TEST(Mlp, RefusesWhatItCannotDo) {
  EXPECT_NE(test::errorOf([] {
              Mlp({"q", 0, {4}, 2});
            }).find("at least one input"),
            std::string::npos);
  EXPECT_NE(test::errorOf([] {
              Mlp({"q", 4, {4, 0}, 2});
            }).find("hidden layer"),
            std::string::npos);
  EXPECT_NE(test::errorOf([] { Mlp({"", 4, {4}, 2}); }).find("prefix"), std::string::npos);
  const Mlp mlp({"q", 4, {4}, 2});
  EXPECT_NE(test::errorOf([&] { MlpWorkspace(mlp, 0); }).find("at least one"), std::string::npos);
  MlpWorkspace workspace(mlp, 3);
  const std::vector<float> parameters(mlp.size()), input(16);
  EXPECT_EQ(test::errorOf([&] { mlp.forward(parameters.data(), input.data(), 4, workspace); }),
            "a batch of 4 does not fit the network's workspace of 3.");
  std::vector<float> d(8);
  EXPECT_EQ(test::errorOf([&] {
              mlp.backwardInput(parameters.data(), 2, d.data(), 3, 2, d.data(), workspace);
            }),
            "the network 'q' has 4 inputs, none at 4.");
}

TEST(Mlp, APortableOneMultipliesByEigenAlone) {
  // one layer without biases is one product
  const Mlp mlp({"q", 30, {}, 50, false, true});
  std::vector<float> parameters = initialised(mlp, 1);
  std::fill(parameters.begin() + 30 * 50, parameters.end(), 0.0f);
  const std::vector<float> input = noise(16 * 30, 2), d_output = noise(16 * 50, 3);
  std::vector<float> product(16 * 50), gradient(mlp.size()), d_weight(50 * 30);
  MlpWorkspace workspace(mlp, 16);
  const float* found = mlp.forward(parameters.data(), input.data(), 16, workspace);
  gemmEigen(Transpose::kNo, Transpose::kYes, 16, 50, 30, 1, input.data(), 30, parameters.data(), 30,
            0, product.data(), 50);
  EXPECT_EQ(std::vector<float>(found, found + product.size()), product);
  mlp.backward(parameters.data(), input.data(), 16, d_output.data(), gradient.data(), nullptr,
               workspace);
  gemmEigen(Transpose::kYes, Transpose::kNo, 50, 30, 16, 1, d_output.data(), 50, input.data(), 30,
            0, d_weight.data(), 30);
  gradient.resize(d_weight.size());
  EXPECT_EQ(gradient, d_weight);
}

}  // namespace
}  // namespace pmeta
