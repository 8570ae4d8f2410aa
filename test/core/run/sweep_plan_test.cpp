#include "pmeta_core/run/sweep.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "../support.h"
#include "pmeta_core/env/mujoco_model.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::TempDir;
using test::writeFile;

SweepPlan gridPlan(const TempDir& dir, std::vector<std::string> assignments) {
  writeFile(dir / "grid.yaml", "experiment: grid\nenvironment: {name: gridworld, sizes: [4]}\n");
  assignments.push_back("results_dir:=" + dir.path());
  SweepPlan plan;
  plan.name = "plan";
  plan.config = dir / "grid.yaml";
  plan.assignments = assignments;
  return plan;
}

std::vector<std::string> namesOf(const SweepPlan& plan) {
  std::vector<std::string> names;
  for (const Experiment& run : planSweep(plan)) names.push_back(run.settings().run_id);
  return names;
}

std::string refused(const std::vector<std::string>& assignments) {
  const TempDir dir;
  return errorOf([&] { planSweep(gridPlan(dir, assignments)); });
}

TEST(SweepPlan, RunsAreNamedAfterTheSettingsThatVary) {
  const TempDir dir;
  EXPECT_EQ(namesOf(gridPlan(dir, {"lambda:=1,5", "seed:=0-1", "rounds:=3"})),
            (std::vector<std::string>{"lambda_1-seed_0", "lambda_1-seed_1", "lambda_5-seed_0",
                                      "lambda_5-seed_1"}));
  EXPECT_EQ(namesOf(gridPlan(dir, {"rounds:=3"})), std::vector<std::string>{"run"});
  EXPECT_EQ(planSweep(gridPlan(dir, {"rounds:=3"}))[0].runDir(),
            dir.path() + "/sweeps/plan/grid/run");
}

TEST(SweepPlan, ValuesAreListsAndRanges) {
  const TempDir dir;
  EXPECT_EQ(namesOf(gridPlan(dir, {"seed:=0-2,5,8-9"})),
            (std::vector<std::string>{"seed_0", "seed_1", "seed_2", "seed_5", "seed_8", "seed_9"}));
  EXPECT_EQ(planSweep(gridPlan(dir, {"sizes:=[4,5],[6]"})).size(), 2u);
  // the largest seed that there is
  EXPECT_EQ(namesOf(gridPlan(dir, {"seed:=9223372036854775807-9223372036854775807"})),
            std::vector<std::string>{"run"});
}

TEST(SweepPlan, RangesThatCannotBeAreRefused) {
  EXPECT_EQ(refused({"seed:=99999999999999999999-5"}),
            "the range '99999999999999999999-5' goes beyond the largest whole number, "
            "9223372036854775807.");
  EXPECT_EQ(refused({"seed:=5-2"}), "the range '5-2' must go up, by less than 100000.");
  EXPECT_EQ(refused({"seed:=0-100000"}), "the range '0-100000' must go up, by less than 100000.");
}

TEST(SweepPlan, UnlikeSettingsGetUnlikeFolders) {
  const TempDir dir;
  writeFile(dir / "half_cheetah.yaml",
            "experiment: cheetah\nlearner: sac\nenvironment: {name: half_cheetah_dir}\n");
  std::filesystem::create_directory(dir / "m");
  for (const char* name : {"m/a.xml", "m_a.xml"}) {
    writeFile(dir / name, shippedModel("half_cheetah") + std::string("<!-- ") + name + " -->\n");
  }
  SweepPlan plan;
  plan.name = "plan";
  plan.config = dir / "half_cheetah.yaml";
  plan.assignments = {"model_file:=" + dir / "m/a.xml" + "," + dir / "m_a.xml",
                      "results_dir:=" + dir.path()};
  const std::vector<std::string> names = namesOf(plan);
  ASSERT_EQ(names.size(), 2u);
  EXPECT_NE(names[0], names[1]);
  EXPECT_EQ(names, namesOf(plan));
}

TEST(SweepPlan, ALongNameIsCutAndToldApart) {
  const TempDir dir;
  std::string list = "[4";
  for (int i = 0; i < 60; ++i) list += ",4";
  const std::string other = list + ",5]";
  const std::vector<std::string> names = namesOf(gridPlan(dir, {"sizes:=" + list + "]," + other}));
  ASSERT_EQ(names.size(), 2u);
  EXPECT_NE(names[0], names[1]);
  for (const std::string& name : names) EXPECT_LE(name.size(), 140u);
}

TEST(SweepPlan, ItsNameIsPlain) {
  const TempDir dir;
  for (const char* name : {"..", "a/b", "", "a b"}) {
    SweepPlan plan = gridPlan(dir, {});
    plan.name = name;
    EXPECT_NE(errorOf([&] { planSweep(plan); }).find("plain name"), std::string::npos) << name;
  }
}

}  // namespace
}  // namespace pmeta
