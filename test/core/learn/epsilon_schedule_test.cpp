#include "pmeta_core/learn/epsilon_schedule.h"

#include <gtest/gtest.h>

namespace pmeta {
namespace {

TEST(EpsilonSchedule, FallsLinearlyAndStays) {
  const EpsilonSchedule epsilon{0.3, 0.01, 200};
  EXPECT_EQ(epsilon.at(0), 0.3);
  EXPECT_NEAR(epsilon.at(50), 0.2275, 1e-15);
  EXPECT_NEAR(epsilon.at(100), 0.155, 1e-15);
  EXPECT_NEAR(epsilon.at(200), 0.01, 1e-15);
  EXPECT_NEAR(epsilon.at(1000000), 0.01, 1e-15);
}

TEST(EpsilonSchedule, MayBeConstantOrRise) {
  const EpsilonSchedule constant{0.1, 0.1, 10};
  const EpsilonSchedule rising{0, 1, 4};
  const EpsilonSchedule at_once{0.3, 0.05, 0};
  for (const std::int64_t done : {0, 3, 99}) {
    EXPECT_EQ(constant.at(done), 0.1);
    EXPECT_EQ(rising.at(done), done < 4 ? 0.25 * static_cast<double>(done) : 1);
    EXPECT_EQ(at_once.at(done), 0.05);
  }
}

}  // namespace
}  // namespace pmeta
