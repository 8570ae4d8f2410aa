#include "pmeta_core/aggregate/trimmed_mix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;

Model modelOf(std::vector<double> values, std::vector<std::uint8_t> present = {}) {
  Model model(ModelLayout(Precision::kFloat64, {{"w", {values.size()}}}));
  model.values = std::move(values);
  model.present = std::move(present);
  return model;
}

template <class Scalar>
Model randomModel(std::size_t n, std::mt19937& random, double absent) {
  const bool is_float = std::is_same<Scalar, float>::value;
  Model model(ModelLayout(is_float ? Precision::kFloat32 : Precision::kFloat64, {{"w", {n}}}));
  auto& values = std::get<std::vector<Scalar>>(model.values);
  std::normal_distribution<double> normal(0, 3);
  for (Scalar& value : values) value = static_cast<Scalar>(normal(random));
  if (absent == 0) return model;
  model.present.assign(n, 1);
  for (std::size_t k = 0; k < n; ++k) {
    if (random() % 1000 >= absent * 1000) continue;
    model.present[k] = 0;
    values[k] = std::numeric_limits<Scalar>::quiet_NaN();
  }
  return model;
}

// one entry, as the definition says
template <class Scalar>
long double expectedEntry(const Model& meta, const std::vector<Model>& models, double beta,
                          double trim, std::size_t k) {
  std::vector<long double> values;
  for (const Model& model : models) {
    if (model.isPresent(k)) values.push_back(std::get<std::vector<Scalar>>(model.values)[k]);
  }
  const long double old = std::get<std::vector<Scalar>>(meta.values)[k];
  if (values.empty()) return old;
  std::sort(values.begin(), values.end());
  std::size_t cut = 0;
  while (cut + 1 <= trim * static_cast<double>(values.size()) + 1e-9) ++cut;
  while (2 * cut >= values.size()) --cut;
  long double sum = 0;
  for (std::size_t i = cut; i < values.size() - cut; ++i) sum += values[i];
  return (1 - static_cast<long double>(beta)) * old +
         beta * sum / static_cast<long double>(values.size() - 2 * cut);
}

std::vector<Contribution> partsOf(const std::vector<Model>& models) {
  std::vector<Contribution> parts;
  for (const Model& model : models) parts.push_back({&model, 1});
  return parts;
}

template <class Scalar>
void expectReference(int count, std::size_t n, double absent, double beta, double trim) {
  std::mt19937 random(static_cast<unsigned>(n) + 1000 * count);
  Model meta = randomModel<Scalar>(n, random, 0);
  const Model before = meta;
  std::vector<Model> models;
  for (int i = 0; i < count; ++i) models.push_back(randomModel<Scalar>(n, random, absent));
  mixTrimmedInto(meta, partsOf(models), beta, trim);
  const double tolerance = std::is_same<Scalar, float>::value ? 2e-6 : 1e-13;
  for (std::size_t k = 0; k < n; ++k) {
    ASSERT_NEAR(std::get<std::vector<Scalar>>(meta.values)[k],
                static_cast<double>(expectedEntry<Scalar>(before, models, beta, trim, k)),
                tolerance)
        << "entry " << k << " of " << n << ", " << count << " models, trim " << trim;
  }
}

TEST(TrimmedMix, MatchesANaiveReference) {
  for (const int count : {1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 17, 33}) {
    for (const std::size_t n : {1, 63, 64, 65, 200}) {
      for (const double absent : {0.0, 0.4, 0.9}) {
        for (const double trim : {0.0, 0.1, 0.2, 0.29, 0.49, 0.5}) {
          expectReference<float>(count, n, absent, 1, trim);
          expectReference<double>(count, n, absent, 0.3, trim);
        }
      }
    }
  }
}

TEST(TrimmedMix, TheMedianIsTheMiddleValueOrTheMeanOfTwo) {
  Model meta = modelOf({100, 100});
  const Model a = modelOf({1, 7}), b = modelOf({-1e300, 8}), c = modelOf({3, 1e300}),
              d = modelOf({2, 9});
  mixTrimmedInto(meta, {{&a, 1}, {&b, 1}, {&c, 1}}, 1, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{1, 8}));
  mixTrimmedInto(meta, {{&a, 1}, {&b, 1}, {&c, 1}, {&d, 1}}, 1, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{1.5, 8.5}));
  mixTrimmedInto(meta, {{&a, 1}, {&d, 1}}, 0.5, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{1.5, 8.25}));
}

TEST(TrimmedMix, CutsTheShareThatWasAskedFor) {
  std::vector<Model> models;
  for (int i = 0; i < 100; ++i) models.push_back(modelOf({static_cast<double>(i * i)}));
  // 29 of 100 at each end, though 0.29 * 100 is a little less in binary
  double sum = 0;
  for (int i = 29; i < 71; ++i) sum += i * i;
  Model meta = modelOf({0});
  mixTrimmedInto(meta, partsOf(models), 1, 0.29);
  EXPECT_EQ(meta.doubles()[0], sum / 42);
}

TEST(TrimmedMix, EntriesAreCutAmongTheirOwnersAlone) {
  Model meta = modelOf({-4, -4, -4});
  const Model a = modelOf({1, 1, 5}, {1, 1, 0}), b = modelOf({2, 900, 5}, {1, 0, 0}),
              c = modelOf({900, 900, 5}, {1, 0, 0});
  mixTrimmedInto(meta, {{&a, 1}, {&b, 1}, {&c, 1}}, 1, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{2, 1, -4}));
}

TEST(TrimmedMix, OneContributionIsTakenAsItIs) {
  std::mt19937 random(3);
  for (const double trim : {0.0, 0.2, 0.5}) {
    Model meta = randomModel<double>(130, random, 0);
    const Model part = randomModel<double>(130, random, 0);
    mixTrimmedInto(meta, {{&part, 7}}, 1, trim);
    EXPECT_TRUE(meta == part);
  }
}

TEST(TrimmedMix, TheOrderDoesNotShowInTheBits) {
  std::mt19937 random(5);
  const Model meta = randomModel<double>(300, random, 0);
  std::vector<Model> models;
  for (int i = 0; i < 7; ++i) models.push_back(randomModel<double>(300, random, 0.2));
  Model first = meta;
  mixTrimmedInto(first, partsOf(models), 0.7, 0.2);
  for (int i = 0; i < 20; ++i) {
    std::shuffle(models.begin(), models.end(), random);
    Model other = meta;
    mixTrimmedInto(other, partsOf(models), 0.7, 0.2);
    EXPECT_TRUE(other == first);
  }
}

TEST(TrimmedMix, AMinorityCannotMoveAnEntryBeyondTheOthers) {
  std::mt19937 random(6);
  for (const double trim : {0.4, 0.5}) {
    std::vector<Model> models;
    for (const double value : {-1.0, 0.0, 1.0, 1e308, 1e308}) models.push_back(modelOf({value}));
    Model meta = modelOf({50});
    mixTrimmedInto(meta, partsOf(models), 1, trim);
    EXPECT_LE(std::abs(meta.doubles()[0]), 1);
  }
}

TEST(TrimmedMix, WithoutContributionsNothingMoves) {
  Model meta = modelOf({1, 2});
  mixTrimmedInto(meta, {}, 1, 0.5);
  EXPECT_EQ(meta.doubles(), (std::vector<double>{1, 2}));
}

TEST(TrimmedMix, RefusesWhatItCannotMix) {
  Model meta = modelOf({1, 2});
  const Model good = modelOf({3, 4}), other = modelOf({3, 4, 5}), before = meta;
  EXPECT_EQ(errorOf([&] {
              mixTrimmedInto(meta, {{&good, 1}, {&good, 2}}, 1, 0.5);
            }),
            "a median or trimmed mean takes models of equal weights only.");
  EXPECT_EQ(errorOf([&] {
              mixTrimmedInto(meta, {{&good, 1}, {&other, 1}}, 1, 0.5);
            }),
            "models of different layouts cannot be averaged.");
  for (const double trim : {-0.1, 0.6, std::nan("")}) {
    EXPECT_EQ(errorOf([&] {
                mixTrimmedInto(meta, {{&good, 1}}, 1, trim);
              }),
              "the share that is cut at each end must be from 0 to 0.5.");
  }
  EXPECT_TRUE(meta == before);
}

}  // namespace
}  // namespace pmeta
