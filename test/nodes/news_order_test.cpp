#include "common/news_order.h"

#include <gtest/gtest.h>

namespace pmeta_nodes {
namespace {

TEST(NewsOrder, TakesNothingOlderThanTheNewestOrThanItsStart) {
  NewsOrder order(ros::Time(100));
  EXPECT_FALSE(order.take(ros::Time(99, 999999999))) << "of a run before, sent again";
  EXPECT_TRUE(order.take(ros::Time(100)));
  EXPECT_TRUE(order.take(ros::Time(105)));
  EXPECT_FALSE(order.take(ros::Time(104)));
  EXPECT_TRUE(order.take(ros::Time(105))) << "the same once more changes nothing";

  NewsOrder any;
  EXPECT_TRUE(any.take(ros::Time(1)));
}

}  // namespace
}  // namespace pmeta_nodes
