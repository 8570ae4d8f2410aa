#include "pmeta_core/aggregate/norm_bound.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pmeta {
namespace {

using Reasons = std::vector<std::string>;

std::vector<int> objectedTo(const NormBound& bound, const std::vector<double>& norms) {
  std::vector<int> found;
  const Reasons reasons = bound.objections(norms);
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (!reasons[i].empty()) found.push_back(static_cast<int>(i));
  }
  return found;
}

TEST(NormBound, WithoutBoundsEverythingPasses) {
  EXPECT_FALSE(NormBound().bounds());
  EXPECT_EQ(objectedTo({}, {1, HUGE_VAL, 1e300, 0}), std::vector<int>{});
}

TEST(NormBound, TheGreatestNormIsStillAllowed) {
  const NormBound bound = {2, 0};
  EXPECT_EQ(objectedTo(bound, {2, std::nextafter(2.0, 3.0), 0}), std::vector<int>{1});
  EXPECT_EQ(bound.objections({812.3456}).front(),
            "its distance to the meta-policy, 812.3, is above aggregation.max_update_norm, 2");
}

TEST(NormBound, OutliersAreJudgedByTheMedian) {
  const NormBound bound = {0, 3};
  EXPECT_EQ(objectedTo(bound, {1, 3, 3.5, 1, 1}), std::vector<int>{2});
  EXPECT_EQ(objectedTo(bound, {7, 1, 2, 8}), std::vector<int>{}) << "the median is 4.5";
  EXPECT_EQ(objectedTo(bound, {14, 1, 2, 3}), std::vector<int>{0}) << "the median is 2.5";
  EXPECT_EQ(
      bound.objections({1, 9, 1})[1],
      "its distance to the meta-policy, 9, is above aggregation.outlier_factor, 3, times this "
      "round's median, 1");
}

TEST(NormBound, OfTwoNoneIsTheOutlier) {
  EXPECT_EQ(objectedTo({0, 2}, {1, 1e9}), std::vector<int>{});
  EXPECT_EQ(objectedTo({0, 2}, {5}), std::vector<int>{});
  EXPECT_EQ(objectedTo({100, 2}, {1, 1e9}), std::vector<int>{1}) << "the other bound holds still";
}

TEST(NormBound, NormsThatOverflowNeverPass) {
  EXPECT_EQ(objectedTo({0, 2}, {HUGE_VAL, HUGE_VAL, HUGE_VAL}), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(objectedTo({1e308, 0}, {HUGE_VAL}), std::vector<int>{0});
}

}  // namespace
}  // namespace pmeta
