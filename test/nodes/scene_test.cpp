#include "pmeta_nodes/scene.h"

#include <gtest/gtest.h>

#include "scene_support.h"

namespace pmeta_nodes {
namespace {

// rows that nothing refers to must not be lost when programs are linked
TEST(Scene, EveryShippedFamilyHasOne) {
  for (const char* name :
       {"ant_fwd_back", "cart_pole", "gridworld", "half_cheetah_dir", "half_cheetah_vel",
        "mountain_car", "sparse_point_robot", "walker_2d_params"}) {
    EXPECT_NE(nullptr, scenes().find(name)) << name;
    EXPECT_NO_THROW(pmeta::envFamilies().at(name)) << name;
  }
}

}  // namespace
}  // namespace pmeta_nodes
