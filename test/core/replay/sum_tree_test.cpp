#include "pmeta_core/replay/sum_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pmeta_core/base/rng.h"

namespace pmeta {
namespace {

double sumOf(const std::vector<double>& weights) {
  double sum = 0;
  for (const double weight : weights) sum += weight;
  return sum;
}

std::size_t linearSearch(const std::vector<double>& weights, double prefix) {
  double sum = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    sum += weights[k];
    if (prefix < sum) return k;
  }
  return weights.size();
}

TEST(SumTree, HoldsWhatIsSetAndItsSumAfterRandomOperations) {
  for (const std::size_t capacity : {1u, 2u, 3u, 7u, 8u, 100u}) {
    SumTree tree(capacity);
    std::vector<double> weights(capacity, 0.0);
    Rng rng(capacity, 0, Stream::kSample);
    EXPECT_EQ(tree.total(), 0);
    for (int i = 0; i < 2000; ++i) {
      const std::size_t leaf = rng.below(capacity);
      // a few orders of magnitude, now and then nothing
      weights[leaf] = rng.below(8) == 0 ? 0 : std::exp(6 * rng.normal());
      tree.set(leaf, weights[leaf]);
      ASSERT_NEAR(tree.total(), sumOf(weights), 1e-12 * sumOf(weights));
    }
    for (std::size_t k = 0; k < capacity; ++k) EXPECT_EQ(tree.get(k), weights[k]);
  }
}

TEST(SumTree, TotalReturnsToNothingWithoutRest) {
  SumTree tree(50);
  Rng rng(1, 0, Stream::kSample);
  for (int i = 0; i < 5000; ++i) tree.set(rng.below(50), rng.uniform() * 1e9);
  for (std::size_t k = 0; k < 50; ++k) tree.set(k, 0);
  EXPECT_EQ(tree.total(), 0);
}

TEST(SumTree, FindsWhatALinearSearchFinds) {
  for (const std::size_t capacity : {1u, 5u, 16u, 33u}) {
    // small integers: every sum is exact, so that both searches see the same numbers
    SumTree tree(capacity);
    std::vector<double> weights(capacity);
    Rng rng(capacity, 1, Stream::kSample);
    for (int i = 0; i < 300; ++i) {
      for (std::size_t k = 0; k < capacity; ++k) {
        weights[k] = static_cast<double>(rng.below(4));
        tree.set(k, weights[k]);
      }
      for (double prefix = 0; prefix < tree.total(); prefix += 0.5) {
        ASSERT_EQ(tree.find(prefix), linearSearch(weights, prefix));
      }
    }
  }
}

TEST(SumTree, NeverFindsAWeightOfZero) {
  SumTree tree(9);
  tree.set(3, 0.1);
  tree.set(7, 1e-9);
  EXPECT_EQ(tree.find(0), 3u);
  EXPECT_EQ(tree.find(0.1), 7u);
  for (const double prefix : {tree.total(), 2.0, 1e300}) EXPECT_EQ(tree.find(prefix), 7u);
  tree.set(7, 0);
  for (const double prefix : {0.0, 0.1, 5.0}) EXPECT_EQ(tree.find(prefix), 3u);
}

TEST(SumTree, DrawsInProportionToTheWeights) {
  const std::vector<double> weights = {3, 0, 1, 0.5, 7, 2.5, 0, 6};
  SumTree tree(weights.size());
  for (std::size_t k = 0; k < weights.size(); ++k) tree.set(k, weights[k]);
  Rng rng(4, 0, Stream::kSample);
  std::vector<int> counts(weights.size());
  const int draws = 100000;
  for (int i = 0; i < draws; ++i) ++counts[tree.find(rng.uniform() * tree.total())];
  double statistic = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const double expected = draws * weights[k] / sumOf(weights);
    if (expected == 0) {
      EXPECT_EQ(counts[k], 0);
    } else {
      statistic += (counts[k] - expected) * (counts[k] - expected) / expected;
    }
  }
  EXPECT_LT(statistic, 25.7);  // 99.99 %, 5 degrees of freedom
}

}  // namespace
}  // namespace pmeta
