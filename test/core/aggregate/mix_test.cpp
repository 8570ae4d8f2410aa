#include "pmeta_core/aggregate/mix.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

ModelLayout layoutOf(Precision precision, std::size_t n) { return {precision, {{"w", {n}}}}; }

template <class Scalar>
std::vector<Scalar>& valuesOf(Model& model) {
  return std::get<std::vector<Scalar>>(model.values);
}

// models with random values, a share of them masked, NaN where absent
template <class Scalar>
Model randomModel(std::size_t n, std::mt19937& random, double absent) {
  const Precision precision =
      std::is_same<Scalar, float>::value ? Precision::kFloat32 : Precision::kFloat64;
  Model model(layoutOf(precision, n));
  std::normal_distribution<double> normal(0, 3);
  for (Scalar& value : valuesOf<Scalar>(model)) value = static_cast<Scalar>(normal(random));
  if (absent > 0) {
    model.present.assign(n, 1);
    for (std::size_t k = 0; k < n; ++k) {
      if (random() % 1000 >= absent * 1000) continue;
      model.present[k] = 0;
      valuesOf<Scalar>(model)[k] = std::numeric_limits<Scalar>::quiet_NaN();
    }
  }
  return model;
}

// entry by entry in long double, models in the innermost loop
template <class Scalar>
long double mixedEntry(const Model& meta, const std::vector<Contribution>& parts, double beta,
                       std::size_t k) {
  long double sum = 0, weight = 0;
  for (const Contribution& part : parts) {
    if (!part.model->present.empty() && part.model->present[k] == 0) continue;
    sum += static_cast<long double>(part.weight) *
           std::get<std::vector<Scalar>>(part.model->values)[k];
    weight += part.weight;
  }
  const long double old = std::get<std::vector<Scalar>>(meta.values)[k];
  return weight == 0 ? old : (1 - static_cast<long double>(beta)) * old + beta * (sum / weight);
}

template <class Scalar>
void expectReference(std::size_t n, double absent, double beta) {
  std::mt19937 random(static_cast<unsigned>(n));
  Model meta = randomModel<Scalar>(n, random, 0);
  std::vector<Model> models;
  for (int i = 0; i < 5; ++i) models.push_back(randomModel<Scalar>(n, random, absent));
  std::vector<Contribution> parts;
  for (int i = 0; i < 5; ++i) parts.push_back({&models[i], 0.5 + i});
  const Model before = meta;
  mixInto(meta, parts, beta);
  const double tolerance = std::is_same<Scalar, float>::value ? 1e-7 : 2e-15;
  for (std::size_t k = 0; k < n; ++k) {
    const long double expected = mixedEntry<Scalar>(before, parts, beta, k);
    ASSERT_NEAR(valuesOf<Scalar>(meta)[k], static_cast<double>(expected), 20 * tolerance)
        << "entry " << k << " of " << n << ", beta " << beta;
  }
}

TEST(Mix, MatchesANaiveReferenceAroundTheChunkSize) {
  for (const std::size_t n : {1, 2, 7, 1023, 8191, 8192, 8193, 20000}) {
    for (const double absent : {0.0, 0.3, 0.9}) {
      for (const double beta : {0.0, 0.3, 1.0}) {
        expectReference<float>(n, absent, beta);
        expectReference<double>(n, absent, beta);
      }
    }
  }
}

TEST(Mix, EntriesNobodyOwnsKeepTheirBits) {
  Model meta(layoutOf(Precision::kFloat64, 2000));
  for (std::size_t k = 0; k < 2000; ++k) meta.doubles()[k] = std::sin(k) * 1e-3;
  meta.doubles()[4] = -0.0;
  meta.doubles()[1500] = std::nan("");
  Model a = meta, b = meta;
  a.present.assign(2000, 0);
  b.present.assign(2000, 0);
  for (std::size_t k = 0; k < 2000; k += 3) a.present[k] = 1;
  for (std::size_t k = 0; k < 2000; k += 5) b.present[k] = 1;
  b.present[1500] = a.present[1500] = 0;
  const Model before = meta;
  for (double& value : a.doubles()) value += 1;
  for (double& value : b.doubles()) value += 1;
  mixInto(meta, {{&a, 1}, {&b, 2}}, 0.7);
  for (std::size_t k = 0; k < 2000; ++k) {
    const bool same = std::memcmp(&meta.doubles()[k], &before.doubles()[k], sizeof(double)) == 0;
    EXPECT_EQ(same, !a.isPresent(k) && !b.isPresent(k)) << k;
  }
}

TEST(Mix, AMaskOfOnesIsNoMask) {
  std::mt19937 random(4);
  Model plain = randomModel<double>(3000, random, 0);
  Model a = randomModel<double>(3000, random, 0), b = randomModel<double>(3000, random, 0);
  Model masked = plain, c = a;
  c.present.assign(3000, 1);
  mixInto(plain, {{&a, 1}, {&b, 0.3}}, 0.6);
  mixInto(masked, {{&c, 1}, {&b, 0.3}}, 0.6);
  EXPECT_TRUE(plain == masked);
}

TEST(Mix, DependsOnTheOrderGivenAndNothingElse) {
  std::mt19937 random(5);
  const Model meta = randomModel<double>(1500, random, 0);
  std::vector<Model> models;
  for (int i = 0; i < 4; ++i) models.push_back(randomModel<double>(1500, random, 0));
  const auto mixed = [&](const std::vector<int>& order) {
    Model out = meta;
    std::vector<Contribution> parts;
    for (const int i : order) parts.push_back({&models[i], 1.0 + 0.1 * i});
    mixInto(out, parts, 1);
    return out;
  };
  EXPECT_TRUE(mixed({0, 1, 2, 3}) == mixed({0, 1, 2, 3}));
  // rounding shows another order: so the first line could have failed
  EXPECT_FALSE(mixed({0, 1, 2, 3}) == mixed({3, 1, 0, 2}));
}

TEST(Mix, SumsRunInTheOrderGivenInDouble) {
  // (1e16 + 1) - 1e16 is 0 in double, (1e16 - 1e16) + 1 is 1
  Model a(layoutOf(Precision::kFloat64, 1)), b = a, c = a, meta = a;
  a.doubles() = {1e16};
  b.doubles() = {1};
  c.doubles() = {-1e16};
  mixInto(meta, {{&a, 1}, {&b, 1}, {&c, 1}}, 1);
  EXPECT_EQ(meta.doubles()[0], 0);
  mixInto(meta, {{&a, 1}, {&c, 1}, {&b, 1}}, 1);
  EXPECT_EQ(meta.doubles()[0], 1.0 / 3);
}

TEST(Mix, FloatsAreSummedInDouble) {
  // in float, 2^24 + 1 + 1 stays 2^24
  const float big = 16777216.0f;
  Model a(layoutOf(Precision::kFloat32, 1)), b = a, c = a, d = a, meta = a;
  a.floats() = {big};
  b.floats() = {1};
  c.floats() = {1};
  d.floats() = {-big};
  mixInto(meta, {{&a, 1}, {&b, 1}, {&c, 1}, {&d, 1}}, 1);
  EXPECT_EQ(meta.floats()[0], 0.5f);
}

TEST(Mix, BetaZeroLeavesTheMetaModel) {
  std::mt19937 random(6);
  for (const double absent : {0.0, 0.5}) {
    Model meta = randomModel<float>(1100, random, 0);
    const Model part = randomModel<float>(1100, random, absent), before = meta;
    mixInto(meta, {{&part, 3}}, 0);
    EXPECT_TRUE(meta == before);
  }
}

TEST(Mix, BetaOneWithOneModelCopiesIt) {
  std::mt19937 random(7);
  Model meta = randomModel<double>(1100, random, 0);
  const Model part = randomModel<double>(1100, random, 0);
  mixInto(meta, {{&part, 1}}, 1);
  EXPECT_TRUE(meta == part);
}

TEST(Mix, WeightsCount) {
  Model a(layoutOf(Precision::kFloat64, 2)), b = a, meta = a;
  a.doubles() = {4, 8};
  b.doubles() = {8, 16};
  meta.doubles() = {100, 100};
  mixInto(meta, {{&a, 3}, {&b, 1}}, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{52.5, 55}));
}

TEST(Mix, WithoutContributionsNothingMoves) {
  Model meta(layoutOf(Precision::kFloat64, 3));
  meta.doubles() = {1, 2, 3};
  const Model before = meta;
  mixInto(meta, {}, 1);
  EXPECT_TRUE(meta == before);
}

TEST(Mix, RefusesOtherLayoutsAndWeightsAndLeavesTheMetaModel) {
  Model meta(layoutOf(Precision::kFloat64, 3)), good = meta;
  good.doubles() = {9, 9, 9};
  const Model before = meta;
  for (const Model& other :
       {Model(layoutOf(Precision::kFloat64, 4)), Model(layoutOf(Precision::kFloat32, 3)),
        Model(ModelLayout(Precision::kFloat64, {{"v", {3}}}))}) {
    EXPECT_EQ(errorOf([&] {
                mixInto(meta, {{&good, 1}, {&other, 1}}, 1);
              }),
              "models of different layouts cannot be averaged.");
  }
  for (const double weight : {0.0, -1.0, std::nan("")}) {
    EXPECT_EQ(errorOf([&] {
                mixInto(meta, {{&good, 1}, {&good, weight}}, 1);
              }),
              "the weight of a model in an average must be positive.");
  }
  EXPECT_TRUE(meta == before);
}

}  // namespace
}  // namespace pmeta
