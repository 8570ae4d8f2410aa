#include "launch/launch_words.h"

#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "pmeta_core/base/error.h"

using pmeta_nodes::handedOn;
using pmeta_nodes::LaunchArguments;
using pmeta_nodes::readLaunchFile;
using pmeta_nodes::splitSettings;
using pmeta_nodes::wordsOfLaunch;
using Names = std::set<std::string>;
using Words = std::vector<std::string>;

namespace {

class Folder : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "launch_words_XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    path_ = pattern;
    std::ofstream(path_ / "top.launch")
        << "<launch><arg name=\"pace\" default=\"0.5\"/>"
           "<include file=\"$(dirname)/common.launch\" pass_all_args=\"true\"/></launch>";
    std::ofstream(path_ / "common.launch")
        << "<launch><arg name=\"seed\" default=\"\" doc=\"x\"/><arg name=\"pace\" default=\"\"/>"
           "<arg name=\"rviz\" default=\"false\"/><arg name=\"view\" default=\"$(arg rviz)\"/>"
           "<arg name=\"speed\" default=\"1\"/>"
           "<arg name=\"given\" value=\"seed:=$(arg seed)&#10; pace:=$(arg pace)&#10;"
           " view:=$(arg view)\"/></launch>";
  }
  void TearDown() override { std::filesystem::remove_all(path_); }

  LaunchArguments arguments() const { return readLaunchFile(path_ / "top.launch", path_); }

  std::filesystem::path path_;
};

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const pmeta::Error& error) {
    return error.what();
  }
  return "";
}

TEST(SplitSettings, SeparatesAtBlanksOutsideOfBracketsAndQuotes) {
  EXPECT_EQ(splitSettings(" slip=0.1  sizes=[4, 5, 6]\tbeta=1 "),
            (Words{"slip:=0.1", "sizes:=[4, 5, 6]", "beta:=1"}));
  EXPECT_EQ(
      splitSettings("model_file='my models/it''s.xml' a=\"x \\\" y\" b={k: [1, 'a ] b']}"),
      (Words{"model_file:='my models/it''s.xml'", "a:=\"x \\\" y\"", "b:={k: [1, 'a ] b']}"}));
  EXPECT_EQ(splitSettings("model_file=/home/o'neil/[x/a.xml seed=1 key_file=a=b"),
            (Words{"model_file:=/home/o'neil/[x/a.xml", "seed:=1", "key_file:=a=b"}));
  EXPECT_EQ(splitSettings(""), (Words{}));
}

TEST(SplitSettings, SaysWhatIsWrong) {
  EXPECT_EQ(refusal([] { splitSettings("sizes=[4, 5"); }),
            "in settings, the value '[4, 5' does not end: close its bracket or quote.");
  EXPECT_EQ(refusal([] { splitSettings("a=1 b"); }),
            "'b' in settings is not of the form key=value.");
  EXPECT_EQ(refusal([] { splitSettings("b:=1"); }),
            "'b:=1' in settings is not of the form key=value.");
  EXPECT_EQ(refusal([] { splitSettings("b c=1"); }),
            "'b' in settings is not of the form key=value.");
}

TEST_F(Folder, ArgumentsAreThoseOfTheLaunchFileAndOfWhatItIncludes) {
  const LaunchArguments read = arguments();
  EXPECT_EQ(read.names, (Names{"given", "seed", "pace", "rviz", "view", "speed"}));
  EXPECT_EQ(read.handed_on, (Names{"seed", "pace", "view"}));
  EXPECT_EQ(read.switches, (Names{"rviz", "view"}));
}

TEST_F(Folder, ArgumentsThatTheLaunchFileKeepsAreNoSettings) {
  EXPECT_EQ(
      handedOn({"speed:=2", "rviz:=true", "slip:= 0.3 ", "seed:=1", "a:=", "view:=0"}, arguments()),
      (Words{"slip:=0.3", "seed:=1", "view:=0"}));
}

TEST_F(Folder, WhatRoslaunchCannotTakeIsRefusedInASentence) {
  const auto refused = [&](const char* word) {
    return refusal([&] { handedOn({word}, arguments()); });
  };
  EXPECT_EQ(refused("rviz:=yes"), "rviz is 'yes' but must be true or false.");
  EXPECT_EQ(refused("seed"), "'seed' is not an assignment: write key:=value.");
  EXPECT_EQ(refused("slip:=a:=b"),
            "'slip:=a:=b' has a second ':=', which roslaunch does not take.");
  EXPECT_EQ(refused("seed:=$(x)"), "seed is '$(x)', but roslaunch takes '$(' for a substitution.");
  EXPECT_EQ(handedOn({"slip:=$(x)", "seed:=$x"}, arguments()), (Words{"slip:=$(x)", "seed:=$x"}));
}

TEST_F(Folder, TheCommandLineHasWhatRoslaunchDrops) {
  const std::string lines = "config.yaml\n  agents.launch\n seed:=4\n pace:=0.5\n view:=false";
  const Words command = {"/usr/bin/python3", "/usr/bin/roslaunch", "--screen",
                         "pmeta_nodes",      "top.launch",         "lamda:=5",
                         "seed:=it's",       "__log:=x",           "speed:=2"};
  EXPECT_EQ(wordsOfLaunch(lines, command, path_),
            (Words{"config.yaml", "agents.launch", "pace:=0.5", "view:=false", "lamda:=5",
                   "seed:=it's"}));
}

TEST_F(Folder, OtherLaunchFilesHaveArgumentsOfTheirOwn) {
  const std::string lines = "config.yaml\nagents.launch\nseed:=4";
  const Words same = (Words{"config.yaml", "agents.launch", "seed:=4"});
  EXPECT_EQ(wordsOfLaunch(lines, {}, path_), same);
  EXPECT_EQ(wordsOfLaunch(lines, {"roslaunch", "robot", "top.launch", "lamda:=5"}, path_), same);
  EXPECT_EQ(wordsOfLaunch(lines, {"roslaunch", "/x/top.launch", "lamda:=5"}, path_), same);
  const std::string top = path_ / "." / "top.launch";
  EXPECT_EQ(wordsOfLaunch(lines, {"roslaunch", top, "lamda:=5"}, path_),
            (Words{"config.yaml", "agents.launch", "seed:=4", "lamda:=5"}));
}

TEST_F(Folder, ThoseThatIncludeOneOfPmetasAreUnderstood) {
  std::filesystem::create_directory(path_ / "robot");
  const std::string file = path_ / "robot/robot.launch";
  std::ofstream(file) << "<launch><arg name=\"port\" default=\"\"/>"
                         "<include file=\"$(find pmeta_nodes)/launch/common.launch\"/></launch>";
  EXPECT_EQ(
      wordsOfLaunch("config.yaml\nseed:=", {"roslaunch", file, "lamda:=5", "port:=COM1"}, path_),
      (Words{"config.yaml", "seed:=", "lamda:=5"}));
}

}  // namespace
