#include "pmeta_core/learn/gradient_surgery.h"

#include <gtest/gtest.h>

namespace pmeta {
namespace {

AlignedFloats operated(const std::vector<AlignedFloats>& gradients) {
  AlignedFloats scratch(gradients[0].size()), sum(gradients[0].size());
  Rng rng(1, 0, Stream::kSample);
  operate(gradients, rng, scratch, sum.data());
  return sum;
}

TEST(GradientSurgery, GradientsThatAgreeAreSummed) {
  EXPECT_EQ(operated({{1, 0, 2}, {1, 1, 0}}), (AlignedFloats{2, 1, 2}));
  EXPECT_EQ(operated({{3, -1, 0}}), (AlignedFloats{3, -1, 0}));
}

TEST(GradientSurgery, OfConflictingOnesEachIsProjectedOntoTheOthersNormalPlane) {
  // (1, 0) - (-1 / 2) (-1, 1) = (0.5, 0.5);  (-1, 1) - (-1 / 1) (1, 0) = (0, 1)
  EXPECT_EQ(operated({{1, 0}, {-1, 1}}), (AlignedFloats{0.5, 1.5}));
}

TEST(GradientSurgery, OppositeOnesCancelAndLeaveNothing) {
  EXPECT_EQ(operated({{2, 4}, {-1, -2}}), (AlignedFloats{0, 0}));
}

TEST(GradientSurgery, OthersCountAsTheyWereBefore) {
  // the third one conflicts with the first alone, and takes nothing from what is left of it
  const AlignedFloats sum = operated({{1, 0, 0}, {0, 1, 0}, {-1, 0, 1}});
  EXPECT_EQ(sum, (AlignedFloats{0.5, 1, 1.5}));
}

}  // namespace
}  // namespace pmeta
