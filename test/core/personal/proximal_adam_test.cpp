#include "pmeta_core/personal/proximal_adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <memory>
#include <vector>

#include "../allocations.h"
#include "../memory_state.h"
#include "../support.h"
#include "pmeta_core/nn/kernels.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {
namespace {

std::vector<float> noise(std::size_t n, std::uint64_t seed, double size = 1) {
  Rng rng(seed, n, Stream::kMeasure);
  std::vector<float> values(n);
  for (float& value : values) value = static_cast<float>(size * rng.normal());
  return values;
}

TEST(ProximalAdam, TakesTorchsFirstThreeSteps) {
  // lr 0.1 on one parameter from 1 with gradients 1, -2, 0.5, worked out by hand
  ProximalAdamSettings settings;
  settings.learning_rate = 0.1;
  float phi = 1;
  ProximalAdam optimizer(&phi, nullptr, 1, settings);
  const float gradients[] = {1, -2, 0.5f};
  const double expected[] = {0.900000001, 0.936610353, 0.950279420};
  for (int t = 0; t < 3; ++t) {
    optimizer.beginUpdate();
    optimizer.apply(0, &gradients[t], 1);
    EXPECT_NEAR(phi, expected[t], 2e-7);
  }
}

TEST(ProximalAdam, AgreesWithKingmaAndBaInDouble) {
  // the textbook's form: corrected moments, no step size of its own
  const std::size_t n = 101;
  ProximalAdamSettings settings;
  settings.learning_rate = 3e-3;
  settings.beta1 = 0.8;
  settings.beta2 = 0.99;
  settings.eps = 1e-4;
  std::vector<float> phi = noise(n, 1);
  std::vector<double> x(phi.begin(), phi.end()), m(n), v(n);
  ProximalAdam optimizer(phi.data(), nullptr, n, settings);
  for (int t = 1; t <= 200; ++t) {
    const auto gradient = noise(n, 100 + static_cast<std::uint64_t>(t));
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), n);
    for (std::size_t k = 0; k < n; ++k) {
      const double g = gradient[k];
      m[k] += (1 - 0.8) * (g - m[k]);
      v[k] += (1 - 0.99) * (g * g - v[k]);
      const double m_hat = m[k] / (1 - std::pow(0.8, t)), v_hat = v[k] / (1 - std::pow(0.99, t));
      x[k] -= 3e-3 * m_hat / (std::sqrt(v_hat) + 1e-4);
    }
  }
  for (std::size_t k = 0; k < n; ++k) EXPECT_NEAR(phi[k], x[k], 5e-6);
  EXPECT_EQ(test::stateOf(optimizer).get<std::int64_t>("updates").at(0), 200);
}

class ProximalAdamOf : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Variants, ProximalAdamOf, ::testing::Values(false, true),
                         [](const auto& test) { return test.param ? "Coupled" : "Decoupled"; });

TEST_P(ProximalAdamOf, OnePassEqualsTheSeparateSteps) {
  const std::size_t n = 53;
  ProximalAdamSettings settings;
  settings.alpha = 2e-3;
  settings.lambda = 20;
  settings.eta = 1e-2;
  settings.coupled = GetParam();
  std::vector<float> phi = noise(n, 1), omega = noise(n, 2), target = noise(n, 3);
  std::vector<float> x = phi, o = omega, y = target;
  ProximalAdam fused(phi.data(), omega.data(), n, settings);
  ProximalAdam adam(x.data(), nullptr, n, settings);
  for (std::uint64_t t = 0; t < 50; ++t) {
    std::vector<float> gradient = noise(n, 100 + t);
    fused.beginUpdate();
    fused.apply(0, gradient.data(), n, target.data(), 0.05);

    if (settings.coupled) {
      for (std::size_t k = 0; k < n; ++k) gradient[k] += 20 * (x[k] - o[k]);
    }
    adam.beginUpdate();
    adam.apply(0, gradient.data(), n);
    if (!settings.coupled) {
      for (std::size_t k = 0; k < n; ++k) x[k] -= 0.04f * (x[k] - o[k]);
    }
    for (std::size_t k = 0; k < n; ++k) o[k] += 0.2f * (x[k] - o[k]);
    for (std::size_t k = 0; k < n; ++k) y[k] += 0.05f * (x[k] - y[k]);
  }
  for (std::size_t k = 0; k < n; ++k) {
    EXPECT_NEAR(phi[k], x[k], 1e-6);
    EXPECT_NEAR(omega[k], o[k], 1e-6);
    EXPECT_NEAR(target[k], y[k], 1e-6);
  }
}

TEST(ProximalAdam, PullUsesTheOldAuxiliaryAndTheAuxiliaryTheNewPersonal) {
  // no gradient: phi 3 -> 3 - 0.5 (3 - 1) = 2, omega 1 -> 1 + 0.25 (2 - 1) = 1.25
  ProximalAdamSettings settings;
  settings.alpha = 0.5;
  settings.lambda = 1;
  settings.eta = 0.25;
  float phi = 3, omega = 1;
  const float gradient = 0;
  ProximalAdam optimizer(&phi, &omega, 1, settings);
  optimizer.beginUpdate();
  optimizer.apply(0, &gradient, 1);
  EXPECT_EQ(phi, 2);
  EXPECT_EQ(omega, 1.25f);
}

TEST(ProximalAdam, AtRestNothingMoves) {
  for (const bool coupled : {false, true}) {
    ProximalAdamSettings settings;
    settings.lambda = 15;
    settings.coupled = coupled;
    std::vector<float> phi = noise(40, 1), omega = phi;
    const std::vector<float> before = phi, gradient(40);
    ProximalAdam optimizer(phi.data(), omega.data(), 40, settings);
    for (int t = 0; t < 5; ++t) {
      optimizer.beginUpdate();
      optimizer.apply(0, gradient.data(), 40);
    }
    EXPECT_EQ(phi, before);
    EXPECT_EQ(omega, before);
  }
}

TEST(ProximalAdam, WithoutLambdaItIsAdamAndTheAuxiliaryStays) {
  std::vector<float> phi = noise(40, 1), omega = noise(40, 2), alone = phi;
  const std::vector<float> before = omega, gradient = noise(40, 3);
  ProximalAdam with(phi.data(), omega.data(), 40, {}), without(alone.data(), nullptr, 40, {});
  for (ProximalAdam* optimizer : {&with, &without}) {
    optimizer->beginUpdate();
    optimizer->apply(0, gradient.data(), 40);
  }
  EXPECT_EQ(phi, alone);
  EXPECT_EQ(omega, before);
}

TEST(ProximalAdam, ARangeMayHaveALambdaOfItsOwn) {
  const std::size_t n = 30;
  ProximalAdamSettings settings;
  settings.lambda = 20;
  settings.eta = 0.01;
  const std::vector<float> start = noise(n, 1), meta = noise(n, 2), gradient = noise(n, 3);
  // what three optimisers with one lambda each do to their tens
  std::vector<float> expected_phi, expected_omega;
  const double lambdas[] = {5, 20, 0};
  for (int part = 0; part < 3; ++part) {
    settings.lambda = lambdas[part];
    std::vector<float> phi(start.begin() + 10 * part, start.begin() + 10 * part + 10);
    std::vector<float> omega(meta.begin() + 10 * part, meta.begin() + 10 * part + 10);
    ProximalAdam alone(phi.data(), omega.data(), 10, settings);
    alone.beginUpdate();
    alone.apply(0, gradient.data() + 10 * part, 10);
    expected_phi.insert(expected_phi.end(), phi.begin(), phi.end());
    expected_omega.insert(expected_omega.end(), omega.begin(), omega.end());
  }

  settings.lambda = 20;
  std::vector<float> phi = start, omega = meta;
  ProximalAdam optimizer(phi.data(), omega.data(), n, settings);
  optimizer.setLambda(0, 10, 5);
  optimizer.setLambda(20, 10, 0);
  optimizer.beginUpdate();
  for (const std::size_t offset : {0, 10, 20}) {
    optimizer.apply(offset, gradient.data() + offset, 10);
  }
  EXPECT_EQ(phi, expected_phi);
  EXPECT_EQ(omega, expected_omega);
  EXPECT_TRUE(std::equal(omega.begin() + 20, omega.end(), meta.begin() + 20));

  EXPECT_THROW(optimizer.setLambda(15, 10, 1), Error) << "overlaps [20, 30)";
  EXPECT_THROW(optimizer.setLambda(10, 21, 1), Error);
  EXPECT_THROW(optimizer.setLambda(10, 5, -1), Error);
  EXPECT_THROW(optimizer.apply(5, gradient.data(), 10), Error) << "over the edge";
}

TEST(ProximalAdam, BlocksInAnyOrderMakeOneUpdate) {
  ProximalAdamSettings settings;
  settings.lambda = 20;
  std::vector<float> phi = noise(64, 1), omega = noise(64, 2), x = phi, o = omega;
  ProximalAdam whole(phi.data(), omega.data(), 64, settings),
      parts(x.data(), o.data(), 64, settings);
  for (std::uint64_t t = 0; t < 3; ++t) {
    const auto gradient = noise(64, 10 + t);
    whole.beginUpdate();
    whole.apply(0, gradient.data(), 64);
    parts.beginUpdate();
    parts.apply(41, &gradient[41], 23);
    parts.apply(0, &gradient[0], 41);
  }
  EXPECT_EQ(phi, x);
  EXPECT_EQ(omega, o);
}

TEST(ProximalAdam, MomentsOfDeadUnitsEndAtZeroAndNotInDenormals) {
  std::vector<float> phi = {1, 2}, gradient = {1e-3f, -1e-3f};
  ProximalAdam optimizer(phi.data(), nullptr, 2, {});
  for (int t = 0; t < 1000; ++t) {
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), 2);
    gradient = {0, 0};
  }
  EXPECT_EQ(optimizer.firstMoment()[0], 0);
  EXPECT_EQ(optimizer.firstMoment()[1], 0);
  EXPECT_GT(optimizer.secondMoment()[0], 0);
}

TEST(ProximalAdam, GoesOnFromARestoredState) {
  std::vector<float> phi = noise(20, 1), copy;
  ProximalAdam first(phi.data(), nullptr, 20, {});
  const auto gradient = noise(20, 2);
  const auto update = [&](ProximalAdam& optimizer) {
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), 20);
  };
  update(first);
  update(first);
  copy = phi;
  ProximalAdam second(copy.data(), nullptr, 20, {});
  test::load(second, test::stateOf(first));
  update(first);
  update(second);
  EXPECT_EQ(phi, copy);
  second.reset();
  EXPECT_EQ(second.firstMoment(), AlignedFloats(20));
  EXPECT_EQ(second.secondMoment(), AlignedFloats(20));
}

TEST(ProximalAdam, RefusesSettingsOutOfRange) {
  float x = 0;
  const auto errorWith = [&](auto change) {
    ProximalAdamSettings settings;
    change(settings);
    return test::errorOf([&] { ProximalAdam(&x, &x, 1, settings); });
  };
  EXPECT_EQ(errorWith([](auto& s) { s.learning_rate = 0; }),
            "Adam's learning_rate is 0, but must be positive.");
  EXPECT_EQ(errorWith([](auto& s) { s.beta1 = 1; }), "Adam's beta1 is 1, but must be in [0, 1).");
  EXPECT_EQ(errorWith([](auto& s) { s.lambda = -2; }),
            "Adam's lambda is -2, but must be at least 0.");
  ProximalAdam fresh(&x, nullptr, 1, {});
  EXPECT_EQ(test::errorOf([&] { fresh.apply(0, &x, 1); }),
            "call beginUpdate() before Adam's apply().");
  fresh.beginUpdate();
  EXPECT_EQ(test::errorOf([&] { fresh.apply(0, &x, 1, &x, 0); }),
            "Adam's tau is 0, but must be in (0, 1].");
}

// a value learner's update, over and over, on data that stay the same
class Update {
 public:
  explicit Update(std::uint64_t seed)
      : mlp_({"q", 4, {96, 80}, 2, true}),
        workspace_(mlp_, 32),
        phi_(mlp_.size()),
        gradient_(mlp_.size()),
        input_(noise(32 * 4, 1)),
        goal_(noise(32, 2)),
        error_(32),
        d_error_(32),
        d_q_(64) {
    Rng rng(seed, 0, Stream::kInitialise);
    mlp_.initialise(phi_.data(), rng);
    omega_ = target_ = phi_;
    ProximalAdamSettings settings;
    settings.lambda = 5;
    optimizer_ = std::make_unique<ProximalAdam>(phi_.data(), omega_.data(), mlp_.size(), settings);
  }

  float operator()() {
    const float* q = mlp_.forward(phi_.data(), input_.data(), 32, workspace_);
    for (std::size_t b = 0; b < 32; ++b) error_[b] = q[2 * b + b % 2] - goal_[b];
    const float loss =
        kernels().huberLoss(error_.data(), nullptr, 1, d_error_.data(), error_.size());
    for (std::size_t b = 0; b < 32; ++b) d_q_[2 * b + b % 2] = d_error_[b];
    mlp_.backward(phi_.data(), input_.data(), 32, d_q_.data(), gradient_.data(), nullptr,
                  workspace_);
    optimizer_->beginUpdate();
    optimizer_->apply(0, gradient_.data(), mlp_.size(), target_.data(), 0.01);
    return loss;
  }

  // FNV-1a over the bytes of all that an update changes
  std::uint64_t hash() const {
    std::uint64_t hash = 0xcbf29ce484222325ULL;
    for (const AlignedFloats* one : {&phi_, &omega_, &target_}) {
      for (const float value : *one) {
        std::uint32_t bits;
        std::memcpy(&bits, &value, sizeof(bits));
        hash = (hash ^ bits) * 0x100000001b3ULL;
      }
    }
    return hash;
  }

 private:
  Mlp mlp_;
  MlpWorkspace workspace_;
  AlignedFloats phi_, omega_, target_, gradient_;
  std::vector<float> input_, goal_, error_, d_error_, d_q_;
  std::unique_ptr<ProximalAdam> optimizer_;
};

TEST(NeuralUpdate, LearnsAndGivesTheSameBitsEveryTime) {
  std::uint64_t hashes[3];
  for (int i = 0; i < 3; ++i) {
    Update update(i == 2 ? 8 : 7);
    const float before = update();
    for (int t = 0; t < 200; ++t) update();
    EXPECT_LT(update(), 0.3 * before);
    hashes[i] = update.hash();
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_NE(hashes[0], hashes[2]);
}

TEST(NeuralUpdate, AllocatesNothingAndStartsNoThread) {
  const auto threads = [] {
    const std::filesystem::directory_iterator tasks("/proc/self/task");
    return std::distance(begin(tasks), end(tasks));
  };
  const auto threads_before = threads();
  Update update(7);
  update();
  const std::size_t before = test::allocations();
  for (int t = 0; t < 20; ++t) update();
  EXPECT_EQ(test::allocations() - before, 0u);
  EXPECT_EQ(threads(), threads_before);
  EXPECT_GT(before, 0u) << "nothing was counted";
}

}  // namespace
}  // namespace pmeta
