#include "pmeta_core/personal/proximal_sgd.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "../support.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/learn/tabular.h"

namespace pmeta {
namespace {

template <class Scalar>
class ProximalSgdOf : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ProximalSgdOf, Scalars);

template <class Scalar>
Scalar tolerance() {
  return std::is_same<Scalar, float>::value ? Scalar(2e-6) : Scalar(1e-14);
}

// one step on Q towards `target`, seen from outside
template <class Scalar>
Scalar stepOnce(Scalar q, Scalar omega, Scalar target, double alpha, double lambda) {
  ProximalSgd<Scalar> optimizer(&q, &omega, 1, alpha, lambda, 0.1);
  const Scalar gradient = q - target;
  optimizer.apply(0, &gradient, 1);
  return q;
}

TYPED_TEST(ProximalSgdOf, StepIsTheClosedForm) {
  for (const double alpha : {0.01, 0.08, 0.5}) {
    for (const double lambda : {0.0, 0.5, 10.0}) {
      for (const double q : {-3.0, 0.0, 2.5}) {
        for (const double omega : {-1.0, 4.0}) {
          for (const double target : {-7.0, 1.0}) {
            const double expected =
                (1 - alpha * (1 + lambda)) * q + alpha * (target + lambda * omega);
            const TypeParam found = stepOnce<TypeParam>(q, omega, target, alpha, lambda);
            EXPECT_NEAR(found, expected, 10 * tolerance<TypeParam>());
          }
        }
      }
    }
  }
}

TYPED_TEST(ProximalSgdOf, ReachesTheMinimiserAtOnceWhereAlphaTimesOnePlusLambdaIsOne) {
  for (const double lambda : {0.0, 1.0, 4.0, 9.0}) {
    const TypeParam found = stepOnce<TypeParam>(100, 2, -3, 1 / (1 + lambda), lambda);
    EXPECT_NEAR(found, (-3 + lambda * 2) / (1 + lambda), 200 * tolerance<TypeParam>());
  }
}

TYPED_TEST(ProximalSgdOf, MinimiserIsAFixedPoint) {
  // (target + lambda omega) / (1 + lambda) with numbers that are exact in binary
  EXPECT_EQ(stepOnce<TypeParam>(4, 5, 1, 0.125, 3), TypeParam(4));
  EXPECT_NE(stepOnce<TypeParam>(4.5, 5, 1, 0.125, 3), TypeParam(4.5));
}

TYPED_TEST(ProximalSgdOf, AuxiliaryMovesByEtaLambdaOfTheGap) {
  std::vector<TypeParam> phi = {1, -2, 8}, omega = {5, 6, 8};
  ProximalSgd<TypeParam> optimizer(phi.data(), omega.data(), 3, 0.1, 10, 0.025);
  optimizer.moveAuxiliary();
  EXPECT_EQ(omega, (std::vector<TypeParam>{4, 4, 8}));
  EXPECT_EQ(phi, (std::vector<TypeParam>{1, -2, 8}));
}

TYPED_TEST(ProximalSgdOf, AuxiliaryBecomesPersonalWhereEtaLambdaIsOne) {
  std::vector<TypeParam> phi, omega;
  for (int k = 0; k < 50; ++k) {
    phi.push_back(static_cast<TypeParam>(std::sin(k) * 20));
    omega.push_back(static_cast<TypeParam>(std::cos(k) * 20));
  }
  ProximalSgd<TypeParam> optimizer(phi.data(), omega.data(), phi.size(), 0.1, 12.5, 0.08);
  optimizer.moveAuxiliary();
  for (std::size_t k = 0; k < phi.size(); ++k) {
    EXPECT_NEAR(omega[k], phi[k], 20 * tolerance<TypeParam>());
  }
}

TYPED_TEST(ProximalSgdOf, WithoutLambdaItIsPlainDescent) {
  std::vector<TypeParam> phi = {1, 2, 3}, omega = {-50, 60, 70};
  const std::vector<TypeParam> before = omega, gradient = {4, -8, 0};
  ProximalSgd<TypeParam> optimizer(phi.data(), omega.data(), 3, 0.25, 0, 0.5);
  optimizer.apply(0, gradient.data(), 3);
  EXPECT_EQ(phi, (std::vector<TypeParam>{0, 4, 3}));
  optimizer.moveAuxiliary();
  EXPECT_EQ(omega, before);
}

TYPED_TEST(ProximalSgdOf, AtRestNothingMoves) {
  std::vector<TypeParam> phi, gradient(20, TypeParam(0));
  for (int k = 0; k < 20; ++k) phi.push_back(static_cast<TypeParam>(std::tan(k)));
  std::vector<TypeParam> omega = phi;
  const std::vector<TypeParam> before = phi;
  ProximalSgd<TypeParam> optimizer(phi.data(), omega.data(), 20, 0.08, 10, 0.08);
  for (int i = 0; i < 5; ++i) {
    optimizer.apply(0, gradient.data(), 20);
    optimizer.moveAuxiliary();
  }
  EXPECT_EQ(phi, before);
  EXPECT_EQ(omega, before);
}

TYPED_TEST(ProximalSgdOf, ApplyTouchesItsBlockOnly) {
  std::vector<TypeParam> phi(10, 1), omega(10, 3);
  const std::vector<TypeParam> gradient = {2, 4, 6};
  ProximalSgd<TypeParam> optimizer(phi.data(), omega.data(), 10, 0.5, 0.5, 1);
  optimizer.apply(4, gradient.data(), 3);
  EXPECT_EQ(omega, std::vector<TypeParam>(10, 3));
  EXPECT_EQ(phi, (std::vector<TypeParam>{1, 1, 1, 1, 0.5, -0.5, -1.5, 1, 1, 1}));
}

TEST(ProximalSgd, SweepsConvergeToTheFixedPointOfTheRegularisedOperator) {
  // frozen auxiliary: (1 + lambda) Q = lambda omega + r + gamma E max Q
  const Gridworld env({4, 3, 3, 0.25}, 4);
  const double alpha = 0.05, lambda = 3, gamma = 0.9;
  QTable q(64, 0.0), omega(64);
  for (std::size_t k = 0; k < 64; ++k) omega[k] = -std::fmod(k * 7.3, 11);
  ProximalSgd<double> optimizer(q.data(), omega.data(), 64, alpha, lambda, 0.1);
  for (int sweep = 0; sweep < 400; ++sweep) {
    QTable gradient(64, 0.0);
    for (const int s : env.ownedStates()) {
      for (int a = 0; a < 4; ++a) {
        gradient[4 * s + a] = q[4 * s + a] - bellmanBackup(env, q, s, a, gamma);
      }
    }
    for (const int s : env.ownedStates()) optimizer.apply(4 * s, &gradient[4 * s], 4);
  }
  for (const int s : env.ownedStates()) {
    for (int a = 0; a < 4; ++a) {
      const int k = 4 * s + a;
      EXPECT_NEAR((1 + lambda) * q[k], lambda * omega[k] + bellmanBackup(env, q, s, a, gamma),
                  1e-11);
    }
  }
}

TEST(ProximalSgd, DivergesAboveTheStatedBoundAndConvergesBelow) {
  // a state that leads to itself: the map is 1 - alpha (1 + lambda - gamma) there and
  // 1 - alpha (1 + lambda + gamma) in the worst direction, of which the signs of two states make
  // use
  const double lambda = 10, gamma = 0.9;
  for (const double share : {0.98, 1.02}) {
    const double alpha = share * 2 / (1 + lambda + gamma);
    std::vector<double> q = {1, -1}, omega = {0, 0};
    ProximalSgd<double> optimizer(q.data(), omega.data(), 2, alpha, lambda, 0);
    for (int i = 0; i < 300; ++i) {
      const double gradient[] = {q[0] - gamma * q[1], q[1] - gamma * q[0]};
      optimizer.apply(0, gradient, 2);
    }
    EXPECT_EQ(std::abs(q[0]) < 1, share < 1) << q[0];
  }
}

TEST(ProximalSgd, TargetFollowsWhatHasMoved) {
  double phi[] = {9, 1, 3}, omega[] = {9, 1, 3}, target[] = {0, 5};
  ProximalSgd<double> optimizer(phi, omega, 3, 0.5, 0, 0);
  const double gradient[] = {2, -2};
  optimizer.apply(1, gradient, 2, target, 0.25);
  EXPECT_DOUBLE_EQ(phi[1], 0);
  EXPECT_DOUBLE_EQ(phi[2], 4);
  EXPECT_DOUBLE_EQ(target[0], 0);
  EXPECT_DOUBLE_EQ(target[1], 5 + 0.25 * (4 - 5));
  EXPECT_EQ(phi[0], 9);
}

}  // namespace
}  // namespace pmeta
