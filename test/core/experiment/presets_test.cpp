#include <gtest/gtest.h>

#include "../support.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {
namespace {

using test::errorOf;

constexpr char kWithPresets[] =
    "rounds: 7\n"
    "personal: {lambda: 3}\n"
    "presets:\n"
    "  paper: {personal: {lambda: 2}, rounds: 5}\n"
    "  deep: {learner: dqn, environment: {name: cart_pole}, dqn: {hidden: [8]}}\n";

TEST(Presets, AreReadOverTheRestAndUnderOverrides) {
  const auto load = [](const std::vector<std::string>& overrides) {
    return Experiment::parse(kWithPresets, "file.yaml", overrides).settings();
  };
  EXPECT_EQ(load({}).rounds, 7);
  EXPECT_EQ(load({}).personal.lambda, 3);
  EXPECT_EQ(load({"preset:=paper"}).rounds, 5);
  EXPECT_EQ(load({"preset:=paper"}).personal.lambda, 2);
  EXPECT_EQ(load({"preset:=paper", "lambda:=4"}).personal.lambda, 4);
  EXPECT_EQ(load({"preset:=deep"}).learner, "dqn");
  EXPECT_EQ(load({"preset:=deep"}).environment, "cart_pole");
}

TEST(Presets, EffectiveSettingsAreReadAgainWithoutTheFile) {
  const auto first = Experiment::parse(kWithPresets, "file.yaml", {"preset:=deep", "run_id:=r"});
  const auto second = Experiment::parse(first.yaml(), "config.yaml");
  EXPECT_EQ(second.yaml(), first.yaml());
  EXPECT_EQ(second.settings().preset, "deep");
}

TEST(Presets, UnknownOnesAreRefusedWithTheKnown) {
  EXPECT_EQ(errorOf([] { Experiment::parse(kWithPresets, "file.yaml", {"preset:=papre"}); }),
            "unknown preset of file.yaml 'papre': did you mean 'paper'? Known are paper, deep.");
  EXPECT_EQ(errorOf([] { Experiment::parse("rounds: 1", "file.yaml", {"preset:=paper"}); }),
            "unknown preset 'paper': file.yaml has none.");
}

TEST(Presets, ErrorsInThemKeepTheirLine) {
  const std::string text = "rounds: 7\npresets:\n  bad:\n    personal:\n      lamda: 2\n";
  EXPECT_EQ(errorOf([&] { Experiment::parse(text, "file.yaml", {"preset:=bad"}); }),
            "unknown setting 'personal.lamda' (file.yaml line 5): did you mean 'personal.lambda'?");
}

}  // namespace
}  // namespace pmeta
