#include "pmeta_core/storage/origin.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "../support.h"
#include "pmeta_core/base/build.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/storage/run_lock.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;

// as another machine wrote it
std::string origin(const Experiment& experiment, const std::string& key, const std::string& value) {
  nlohmann::json json = nlohmann::json::parse(originOf(experiment));
  json["host"] = "desk";
  json[nlohmann::json::json_pointer(key)] = value;
  return json.dump();
}

Experiment cartPole(const std::string& arithmetic) {
  return Experiment::parse("{run_id: r, learner: dqn, environment: {name: cart_pole}}", "text",
                           {"arithmetic:=" + arithmetic});
}

TEST(Origin, TheSameVersionAndSettingsOnTheSameMachineDifferInNothing) {
  const Experiment e = gridExperiment({"run_id:=r"});
  EXPECT_EQ(originOf(e).find('\n'), std::string::npos);
  const Experiment elsewhere = gridExperiment({"run_id:=r", "results_dir:=/other", "pace:=3"});
  const OriginDifference difference = differenceFrom(originOf(e), elsewhere);
  EXPECT_EQ(difference.refusal, "");
  EXPECT_TRUE(difference.warnings.empty());
}

TEST(Origin, AnotherVersionOrSettingIsRefusedByTheNamesOfBothMachines) {
  const Experiment e = gridExperiment({"run_id:=r", "lambda:=10"});
  const std::string here = "'" + hostName() + "' ";
  EXPECT_EQ(
      differenceFrom(origin(e, "/versions/pmeta", "9.9"), e).refusal,
      here + "has pMeta '" + kVersion +
          "', but the run was launched on 'desk' with '9.9': install the same version on both.");
  EXPECT_EQ(differenceFrom(origin(e, "/host", "desk"), gridExperiment({"run_id:=r", "lambda:=5"}))
                .refusal,
            here +
                "makes personal.lambda '5', but the run was launched on 'desk' with '10': give "
                "both the same settings, and the same files that they name.");
  EXPECT_EQ(errorOf([&] { differenceFrom("{}", e); }),
            "the run does not say with what it was launched: launch it with the same version.");
}

TEST(Origin, AnotherSimulatorIsAWarningWhereItSimulates) {
  const Experiment cheetah =
      Experiment::parse("{run_id: r, learner: sac, environment: {name: half_cheetah_dir}}", "text");
  const std::vector<std::string> warnings =
      differenceFrom(origin(cheetah, "/versions/mujoco", "1.50"), cheetah).warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("launched on 'desk' with '1.50'"), std::string::npos);
  const Experiment grid = gridExperiment({"run_id:=r"});
  EXPECT_TRUE(differenceFrom(origin(grid, "/versions/mujoco", "1.50"), grid).warnings.empty());
}

TEST(Origin, AnotherCommitOrProcessorIsAWarning) {
  const Experiment e = gridExperiment({"run_id:=r"});
  const OriginDifference commits = differenceFrom(origin(e, "/commit", "abc"), e);
  EXPECT_EQ(commits.refusal, "");
  ASSERT_EQ(commits.warnings.size(), 1u);
  EXPECT_EQ(commits.warnings[0], "'" + hostName() + "' has commit " + commit() +
                                     ", but the run was launched on 'desk' with abc: the result "
                                     "may be another.");
  // tables are the same on every processor
  EXPECT_TRUE(differenceFrom(origin(e, "/machine/processor", "Z80"), e).warnings.empty());
  const Experiment native = cartPole("native");
  const OriginDifference processors =
      differenceFrom(origin(native, "/machine/processor", "Z80"), native);
  ASSERT_EQ(processors.warnings.size(), 1u);
  EXPECT_NE(processors.warnings[0].find("'desk', which has processor 'Z80', here '"),
            std::string::npos);
  EXPECT_NE(processors.warnings[0].find("arithmetic: portable makes it the same"),
            std::string::npos);
  const Experiment portable = cartPole("portable");
  EXPECT_TRUE(
      differenceFrom(origin(portable, "/machine/processor", "Z80"), portable).warnings.empty());
}

}  // namespace
}  // namespace pmeta
