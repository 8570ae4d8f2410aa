#include "pmeta_core/experiment/results_dir.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <regex>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::ScopedVariable;
using test::TempDir;
using test::writeFile;

TEST(ResultsDir, DefaultsToRosHomeThenHome) {
  const ScopedVariable home("HOME", "/home/me");
  {
    const ScopedVariable ros_home("ROS_HOME", "/var/ros");
    EXPECT_EQ(expandResultsDir(""), "/var/ros/pmeta");
  }
  const ScopedVariable ros_home("ROS_HOME", nullptr);
  EXPECT_EQ(expandResultsDir(""), "/home/me/.ros/pmeta");
}

TEST(ResultsDir, ExpandsTheHomeFolderAndMakesPathsAbsolute) {
  const ScopedVariable home("HOME", "/home/me");
  EXPECT_EQ(expandResultsDir("~"), "/home/me");
  EXPECT_EQ(expandResultsDir("~/runs"), "/home/me/runs");
  EXPECT_EQ(expandResultsDir("/tmp/x/../y"), "/tmp/y");
  EXPECT_EQ(expandResultsDir("runs"), (std::filesystem::current_path() / "runs").string());
  EXPECT_EQ(gridExperiment({"results_dir:=~/runs"}).runDir(), "/home/me/runs/grid/run");
  EXPECT_EQ(gridExperiment({"results_dir:=~"}).runDir(), "/home/me/grid/run");
  const ScopedVariable ros_home("ROS_HOME", "ros");
  EXPECT_EQ(expandResultsDir(""), (std::filesystem::current_path() / "ros/pmeta").string());
}

TEST(ResultsDir, WithoutAHomeItMustBeGiven) {
  const ScopedVariable home("HOME", nullptr), ros_home("ROS_HOME", nullptr);
  const std::string sentence =
      "results_dir is not given and HOME is not set: give results_dir:=DIR.";
  EXPECT_EQ(errorOf([] { expandResultsDir(""); }), sentence);
  EXPECT_NE(errorOf([] { expandResultsDir("~/runs"); }), "(no error)") << "not /runs";
  EXPECT_EQ(expandResultsDir("/tmp/x"), "/tmp/x");
}

TEST(RequireWritable, CreatesTheFolderAndLeavesNothingInIt) {
  const TempDir dir;
  requireWritable(dir / "a/b");
  EXPECT_TRUE(std::filesystem::is_directory(dir / "a/b"));
  EXPECT_TRUE(std::filesystem::is_empty(dir / "a/b"));
}

TEST(RequireWritable, SaysWhyAFolderCannotBeWritten) {
  const TempDir dir;
  writeFile(dir / "file", "x");
  EXPECT_EQ(errorOf([&] { requireWritable(dir / "file/below"); }),
            "the results folder " + (dir / "file/below") +
                " cannot be written (Not a directory): choose another with results_dir:=DIR.");
  EXPECT_EQ(errorOf([&] { requireWritable(dir / "file"); }),
            "the results folder " + (dir / "file") +
                " cannot be written (Not a directory): choose another with results_dir:=DIR.");
}

TEST(UtcTime, HasItsTwoForms) {
  const auto shape = [](std::string text) {
    for (char& c : text) c = c >= '0' && c <= '9' ? '0' : c;
    return text;
  };
  EXPECT_EQ(shape(utcStamp()), "00000000T000000");
  EXPECT_EQ(shape(utcTime()), "0000-00-00T00:00:00Z");
}

}  // namespace
}  // namespace pmeta
