#include "common/private_param.h"

#include <gtest/gtest.h>
#include <ros/ros.h>

#include <map>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

template <class Call>
std::string errorOf(const Call& call) {
  try {
    call();
  } catch (const pmeta::Error& error) {
    return error.what();
  }
  return "(no error)";
}

class PrivateParam : public ::testing::Test {
 protected:
  template <class Value>
  void set(const Value& value) {
    ros::NodeHandle("~").setParam("value", value);
  }
  ~PrivateParam() override { ros::NodeHandle("~").deleteParam("value"); }
};

TEST_F(PrivateParam, IsWhatItIsSetToOrElseTheDefault) {
  EXPECT_TRUE(privateFlag("value", true));
  EXPECT_EQ(privateText("value", "none"), "none");
  EXPECT_EQ(privateIndex("value", -1, 5), -1);
  EXPECT_EQ(privatePositive("value", 2.5, 100), 2.5);
  set(false);
  EXPECT_FALSE(privateFlag("value", true));
  set(std::string("text"));
  EXPECT_EQ(privateText("value", "none"), "text");
  set(5);
  EXPECT_EQ(privateIndex("value", -1, 5), 5);
  EXPECT_EQ(privatePositive("value", 2.5, 100), 5) << "a whole number is a number";
  set(0.5);
  EXPECT_EQ(privatePositive("value", 2.5, 100), 0.5);
}

TEST_F(PrivateParam, MayBeAListOrHaveNames) {
  EXPECT_TRUE(privateNames("value").empty());
  EXPECT_TRUE(privateNumbers("value").empty());
  set(std::vector<std::string>{"elbow", "wrist"});
  EXPECT_EQ(privateNames("value"), (std::vector<std::string>{"elbow", "wrist"}));
  EXPECT_NE(errorOf([] { privateNumbers("value"); }), "(no error)");
  set(std::map<std::string, double>{{"elbow", 0.5}, {"wrist", -1}});
  EXPECT_EQ(privateNumbers("value"),
            (std::map<std::string, double>{{"elbow", 0.5}, {"wrist", -1}}));
  EXPECT_NE(errorOf([] { privateNames("value"); }), "(no error)");
  set(std::vector<double>{1, 2});
  EXPECT_EQ(errorOf([] { privateNames("value"); }),
            "the private parameter value is '{1,2}' but must be a list of names, e.g. [elbow, "
            "wrist]: give _value:=VALUE.");
}

TEST_F(PrivateParam, OfAnotherTypeOrOutOfItsRangeIsRefused) {
  set(1);
  EXPECT_EQ(errorOf([] { privateFlag("value", false); }),
            "the private parameter value is '1' but must be true or false: give _value:=VALUE.");
  EXPECT_NE(errorOf([] { privateText("value", ""); }), "(no error)");
  EXPECT_NE(errorOf([] { privateIndex("value", -1, 0); }), "(no error)");
  set(-1);
  EXPECT_NE(errorOf([] { privateIndex("value", -1, 5); }), "(no error)");
  EXPECT_NE(errorOf([] { privatePositive("value", 1, 5); }), "(no error)");
  set(1.5);
  EXPECT_EQ(errorOf([] { privateIndex("value", -1, 5); }),
            "the private parameter value is '1.5' but must be a whole number from 0 to 5: give "
            "_value:=VALUE.");
  EXPECT_NE(errorOf([] { privatePositive("value", 1, 1); }), "(no error)");
  set(std::string("abc"));
  EXPECT_NE(errorOf([] { privateIndex("value", -1, 5); }), "(no error)");
  EXPECT_NE(errorOf([] { privateFlag("value", false); }), "(no error)");
  EXPECT_NE(errorOf([] { privatePositive("value", 1, 5); }), "(no error)");
}

}  // namespace
}  // namespace pmeta_nodes

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "private_param_test");
  const ros::NodeHandle keep_ros_running;
  return RUN_ALL_TESTS();
}
