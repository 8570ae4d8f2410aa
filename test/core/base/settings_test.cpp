#include "pmeta_core/base/settings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "../support.h"
#include "pmeta_core/base/format.h"
#include "sample_settings.h"

namespace pmeta {
namespace {

using test::errorOf;
using Sample = test::SampleSettings;
using test::TempDir;
using test::writeFile;

std::string readError(const std::string& yaml) {
  return errorOf([&] { Sample().read(yaml); });
}

std::string assignError(const std::string& assignment) {
  return errorOf([&] { Sample().settings.assign(assignment); });
}

TEST(Settings, ReadsEveryKind) {
  Sample s;
  s.read(R"(
title: a title
rounds: 7
seed: 9007199254740993
verbose: false
personal:
  lambda: 2.5
  init: keep
environment:
  sizes: [8, 2]
  slip: 0.25
  labels: [x, "1", 'y z']
  corners: [right, left]
)");
  EXPECT_EQ(s.title, "a title");
  EXPECT_EQ(s.rounds, 7);
  EXPECT_EQ(s.seed, 9007199254740993);
  EXPECT_FALSE(s.verbose);
  EXPECT_EQ(s.lambda, 2.5);
  EXPECT_EQ(s.init, "keep");
  EXPECT_EQ(s.sizes, (std::vector<int>{8, 2}));
  EXPECT_EQ(s.slip, std::vector<double>{0.25});
  EXPECT_EQ(s.labels, (std::vector<std::string>{"x", "1", "y z"}));
  EXPECT_EQ(s.corners, (std::vector<std::string>{"right", "left"}));
  EXPECT_EQ(s.gamma, 0.9) << "what is not given keeps its default";
}

TEST(Settings, UnknownKeysNameTheNearestKnownOne) {
  EXPECT_EQ(readError("personal:\n  lamda: 3\n"),
            "unknown setting 'personal.lamda' (a.yaml line 2): did you mean 'personal.lambda'?");
  EXPECT_EQ(readError("round: 3\n"),
            "unknown setting 'round' (a.yaml line 1): did you mean 'rounds'?");
  EXPECT_EQ(readError("persnal:\n  lambda: 3\n"),
            "unknown setting 'persnal' (a.yaml line 1); known are title, rounds, seed, verbose, "
            "personal.lambda, personal.init, personal.rate, q_learning.rate, q_learning.gamma, "
            "q_learning.offset, environment.sizes, environment.slip, environment.labels, "
            "environment.corners, environment.any.");
}

TEST(Settings, KeysInTheWrongGroupNameTheirOwn) {
  EXPECT_EQ(readError("lambda: 3\n"),
            "unknown setting 'lambda' (a.yaml line 1): did you mean 'personal.lambda'?");
  EXPECT_EQ(readError("environment:\n  lambda: 3\n"),
            "unknown setting 'environment.lambda' (a.yaml line 2): did you mean "
            "'personal.lambda'?");
  // three letters from personal.lambda, but exactly another group's gamma
  EXPECT_EQ(readError("personal:\n  gamma: 0.5\n"),
            "unknown setting 'personal.gamma' (a.yaml line 2): did you mean 'q_learning.gamma'?");
}

TEST(Settings, WrongTypesAreRefused) {
  EXPECT_EQ(readError("rounds: ten\n"),
            "rounds is 'ten' (a.yaml line 1) but must be a whole number, from 1 to 1e+06.");
  EXPECT_EQ(readError("\nrounds: 2.5\n"),
            "rounds is '2.5' (a.yaml line 2) but must be a whole number, from 1 to 1e+06.");
  EXPECT_EQ(readError("rounds: [1, 2]\n"),
            "rounds is '[1, 2]' (a.yaml line 1) but must be a whole number, from 1 to 1e+06.");
  EXPECT_EQ(readError("verbose: yes\n"),
            "verbose is 'yes' (a.yaml line 1) but must be true or false.");
  EXPECT_EQ(readError("personal:\n  lambda: strong\n"),
            "personal.lambda is 'strong' (a.yaml line 2) but must be a number, at least 0.");
  EXPECT_EQ(readError("title: {a: b}\n"), "title is '{a: b}' (a.yaml line 1) but must be text.");
  EXPECT_EQ(readError("title:\n"), "title is '~' (a.yaml line 1) but must be text.");
  EXPECT_EQ(readError("environment: {sizes: [4, big]}\n"),
            "environment.sizes is '[4, big]' (a.yaml line 1) but must be a list of whole numbers, "
            "from 2 to 512.");
  EXPECT_EQ(readError("environment: {labels: [a, [b]]}\n"),
            "environment.labels is '[a, [b]]' (a.yaml line 1) but must be a list of words.");
}

TEST(Settings, ValuesOutOfRangeAreRefused) {
  EXPECT_EQ(readError("rounds: 0\n"),
            "rounds is '0' (a.yaml line 1) but must be a whole number, from 1 to 1e+06.");
  EXPECT_EQ(readError("seed: -1\n"),
            "seed is '-1' (a.yaml line 1) but must be a whole number, at least 0.");
  EXPECT_EQ(readError("seed: 9223372036854775808\n"),
            "seed is '9223372036854775808' (a.yaml line 1) but must be a whole number, at least "
            "0, at most 9223372036854775807.");
  EXPECT_EQ(readError("q_learning: {gamma: 1}\n"),
            "q_learning.gamma is '1' (a.yaml line 1) but must be a number, from 0 to below 1.");
  EXPECT_EQ(readError("personal: {rate: 0}\n"),
            "personal.rate is '0' (a.yaml line 1) but must be a number, above 0.");
  EXPECT_EQ(readError("environment: {slip: [0.5, 1]}\n"),
            "environment.slip is '[0.5, 1]' (a.yaml line 1) but must be a list of numbers, from 0 "
            "to below 1.");
  for (const std::string bad : {"2147483648", "-2147483649", "1e10"}) {
    EXPECT_EQ(readError("q_learning: {offset: " + bad + "}"),
              "q_learning.offset is '" + bad +
                  "' (a.yaml line 1) but must be a whole number, at least -2147483648" +
                  (bad.front() == '-' ? "." : ", at most 2147483647."));
  }
  for (const std::string bad : {"2147483648", "-2147483649", "-9223372036854775808"}) {
    EXPECT_EQ(
        readError("environment: {any: " + bad + "}"),
        "environment.any is '" + bad + "' (a.yaml line 1) but must be a list of whole numbers.");
  }
}

TEST(Settings, ExtremeIntegersAreRead) {
  Sample s;
  s.read("q_learning: {offset: -2147483648}\nenvironment: {any: [-2147483648, 2147483647]}\n");
  EXPECT_EQ(s.offset, std::numeric_limits<int>::min());
  EXPECT_EQ(s.any,
            (std::vector<int>{std::numeric_limits<int>::min(), std::numeric_limits<int>::max()}));
  s.read("seed: 9223372036854775807\n");
  EXPECT_EQ(s.seed, std::numeric_limits<std::int64_t>::max());
}

TEST(Settings, UnknownChoicesAreRefused) {
  EXPECT_EQ(readError("personal: {init: zero}\n"),
            "personal.init is 'zero' (a.yaml line 1) but must be one of meta, keep.");
  EXPECT_EQ(readError("personal: {init: mta}\n"),
            "personal.init is 'mta' (a.yaml line 1) but must be one of meta, keep: did you mean "
            "'meta'?");
  EXPECT_EQ(readError("environment: {corners: [left, top]}\n"),
            "environment.corners holds 'top' (a.yaml line 1) but must be one of left, right.");
  EXPECT_EQ(readError("environment: {corners: [left, rihgt]}\n"),
            "environment.corners holds 'rihgt' (a.yaml line 1) but must be one of left, right: did "
            "you mean 'right'?");
}

TEST(Settings, EmptyListsAreRefused) {
  EXPECT_EQ(readError("environment: {sizes: []}\n"),
            "environment.sizes is '[]' (a.yaml line 1) but must be a list of whole numbers, from "
            "2 to 512.");
}

TEST(Settings, ListsMayBeEmptyWhereThatIsSaid) {
  std::vector<int> whole = {1};
  std::vector<double> numbers = {1.5};
  Settings settings;
  settings.bind("whole", whole, "any", {}, Empty::kAllowed);
  settings.bind("numbers", numbers, "any", {}, Empty::kAllowed);
  settings.assign("whole:=[]");
  settings.read(parseYaml("numbers: []", "a.yaml"), "a.yaml");
  EXPECT_TRUE(whole.empty());
  EXPECT_TRUE(numbers.empty());
  EXPECT_EQ(settings.yaml(), "whole: []\nnumbers: []\n");
  settings.assign("numbers:=[2, 3]");
  EXPECT_EQ(numbers, (std::vector<double>{2, 3}));
  settings.read(parseYaml("whole: []\nnumbers: []\n", "b.yaml"), "b.yaml");
  EXPECT_TRUE(numbers.empty());
}

TEST(Settings, DuplicateKeysAreRefused) {
  EXPECT_EQ(readError("rounds: 3\nseed: 1\nrounds: 4\n"),
            "setting 'rounds' stands twice (a.yaml line 3): keep one of them.");
  EXPECT_EQ(readError("personal:\n  lambda: 3\n  lambda: 3\n"),
            "setting 'personal.lambda' stands twice (a.yaml line 3): keep one of them.");
  EXPECT_EQ(readError("personal: {lambda: 3}\npersonal: {init: keep}\n"),
            "setting 'personal' stands twice (a.yaml line 2): keep one of them.");
  EXPECT_EQ(readError("personal.lambda: 3\npersonal:\n  lambda: 4\n"),
            "setting 'personal.lambda' stands twice (a.yaml line 3): keep one of them.");
}

TEST(Settings, GroupsMustBeMaps) {
  for (const std::string value : {"3", "[lambda, 3]", ""}) {
    EXPECT_EQ(readError("seed: 1\npersonal: " + value + "\n"),
              "'personal' is a group of settings (a.yaml line 2): write its keys below it, "
              "indented.");
  }
}

TEST(Settings, TheDocumentMustBeAMap) {
  for (const std::string text : {"", "# nothing\n", "- a\n- b\n", "word"}) {
    EXPECT_EQ(readError(text), "a.yaml must hold settings as 'key: value' lines.");
  }
}

TEST(Settings, MalformedYamlNamesTheLine) {
  EXPECT_EQ(readError("rounds: 3\nseed: [1, 2\n"),
            "a.yaml line 3 is not valid YAML: end of sequence flow not found.");
  EXPECT_EQ(readError("rounds: 3\n title: x\n"),
            "a.yaml line 2 is not valid YAML: illegal map value.");
  EXPECT_EQ(readError("title: *nobody\n"),
            "a.yaml line 1 is not valid YAML: the referenced anchor is not defined.");
}

TEST(Settings, AListThatHoldsItselfIsRefused) {
  EXPECT_NE(readError("environment: {any: &a [1, *a]}\n"), "(no error)");
}

TEST(Settings, FilesAreNamedInErrors) {
  const TempDir dir;
  EXPECT_EQ(
      errorOf([&] { loadYamlFile(dir / "none.yaml"); }),
      "the settings file " + (dir / "none.yaml") + " cannot be read (No such file or directory).");
  EXPECT_EQ(errorOf([&] { loadYamlFile(dir.path()); }),
            "the settings file " + dir.path() + " cannot be read (it is a folder).");
  writeFile(dir / "list.yaml", "- 1\n");
  EXPECT_EQ(errorOf([&] { loadYamlFile(dir / "list.yaml"); }),
            (dir / "list.yaml") + " must hold settings as 'key: value' lines.");
  writeFile(dir / "empty.yaml", "");
  EXPECT_EQ(errorOf([&] { loadYamlFile(dir / "empty.yaml"); }),
            (dir / "empty.yaml") + " must hold settings as 'key: value' lines.");
  writeFile(dir / "good.yaml", "rounds: 4\n");
  Sample s;
  s.settings.read(loadYamlFile(dir / "good.yaml"), "good.yaml");
  EXPECT_EQ(s.rounds, 4);
}

TEST(Settings, WholeNumbersMayBeWrittenAsFloats) {
  for (const std::string text : {"1e5", "100000.0", "1.0e+5", "+100000"}) {
    Sample s;
    s.read("rounds: " + text);
    EXPECT_EQ(s.rounds, 100000) << text;
  }
}

TEST(Settings, NumbersMustBePlainFiniteAndDecimal) {
  for (const std::string text : {"nan",      ".nan", "inf",  "-inf",  ".inf", "infinity", "0x10",
                                 "1_000",    "1,5",  "1e",   "1e400", "\"\"", "\" 5\"",   "\"5 \"",
                                 "\"\\t5\"", "0b1",  "1e5x", "--1",   "true", "~"}) {
    const std::string value = text == "\"\\t5\""    ? "\t5"
                              : text.front() == '"' ? text.substr(1, text.size() - 2)
                                                    : text;
    EXPECT_EQ(readError("personal: {lambda: '" + value + "'}"),
              "personal.lambda is " + shown(value) +
                  " (a.yaml line 1) but must be a number, at least 0.");
    EXPECT_NE(readError("personal: {lambda: " + text + "}"), "(no error)") << text;
    EXPECT_NE(readError("rounds: " + text), "(no error)") << text;
  }
}

TEST(Settings, AssignOverridesByFullOrShortKey) {
  Sample s;
  s.settings.assign("personal.lambda:=5");
  EXPECT_EQ(s.lambda, 5);
  s.settings.assign("lambda:=6.5");
  EXPECT_EQ(s.lambda, 6.5);
  s.settings.assign("sizes:=[7, 8]");
  EXPECT_EQ(s.sizes, (std::vector<int>{7, 8}));
  s.settings.assign("sizes:=9");
  EXPECT_EQ(s.sizes, std::vector<int>{9});
  s.settings.assign("verbose:=false");
  EXPECT_FALSE(s.verbose);
  s.settings.assign("title:=a:=b");
  EXPECT_EQ(s.title, "a:=b");
}

TEST(Settings, AssignTakesTextAsItStands) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", ""},         {"\"\"", ""},     {"''", ""},           {"~", "~"},
      {"null", "null"}, {"#5", "#5"},     {"~/runs", "~/runs"}, {"007", "007"},
      {"true", "true"}, {"1.50", "1.50"}, {"\"a: b\"", "a: b"}, {"%x", "%x"}};
  for (const auto& [given, expected] : cases) {
    Sample s;
    s.settings.assign("title:=" + given);
    EXPECT_EQ(s.title, expected) << given;
  }
}

TEST(Settings, AssignErrorsQuoteTheAssignment) {
  EXPECT_EQ(assignError("lambda=5"), "'lambda=5' is not an assignment: write key:=value.");
  EXPECT_EQ(assignError(":=5"), "':=5' is not an assignment: write key:=value.");
  EXPECT_EQ(assignError("rate:=5"),
            "setting 'rate' is ambiguous: write one of personal.rate, q_learning.rate.");
  EXPECT_EQ(assignError("lamda:=5"),
            "unknown setting 'lamda' (given as lamda:=5): did you mean 'personal.lambda'?");
  EXPECT_EQ(assignError("lambda:=-1"),
            "personal.lambda is '-1' (given as lambda:=-1) but must be a number, at least 0.");
  EXPECT_EQ(assignError("lambda:="),
            "personal.lambda is '' (given as lambda:=) but must be a number, at least 0.");
  EXPECT_EQ(assignError("lambda:={a: 1}"),
            "personal.lambda is '{a: 1}' (given as lambda:={a: 1}) but must be a number, at least "
            "0.");
  EXPECT_EQ(assignError("title:=a: b"), "title is 'a: b' (given as title:=a: b) but must be text.");
  EXPECT_EQ(assignError("sizes:=[]"),
            "environment.sizes is '[]' (given as sizes:=[]) but must be a list of whole numbers, "
            "from 2 to 512.");
  EXPECT_EQ(assignError("sizes:=[4, 1]"),
            "environment.sizes is '[4, 1]' (given as sizes:=[4, 1]) but must be a list of whole "
            "numbers, from 2 to 512.");
  EXPECT_EQ(assignError("sizes:=[4"),
            "the value of sizes:=[4 is not valid YAML: end of sequence flow not found.");
}

TEST(Settings, ARefusedValueLeavesTheVariable) {
  Sample s;
  for (const std::string bad : {"lambda:=x", "sizes:=[3, 1]", "title:=[]", "rounds:=0"}) {
    EXPECT_NE(errorOf([&] { s.settings.assign(bad); }), "(no error)");
  }
  EXPECT_EQ(s.lambda, 10);
  EXPECT_EQ(s.sizes, (std::vector<int>{4, 5}));
  EXPECT_EQ(s.title, "demo");
  EXPECT_EQ(s.rounds, 10);
}

TEST(Settings, BindingAKeyTwiceIsAMistakeOfTheProgram) {
  Sample s;
  double other = 0;
  EXPECT_THROW(s.settings.bind("personal.lambda", other, ""), std::logic_error);
}

TEST(Range, TellsWhatItHolds) {
  EXPECT_TRUE(Range::atLeast(0).contains(0));
  EXPECT_FALSE(Range::above(0).contains(0));
  EXPECT_TRUE(Range::between(0, 1).contains(1));
  EXPECT_FALSE(Range::halfOpen(0, 1).contains(1));
  EXPECT_FALSE(Range::between(0, 1).contains(std::nan("")));
  EXPECT_EQ(Range().text(), "any");
  EXPECT_EQ(Range::atLeast(0).text(), "at least 0");
  EXPECT_EQ(Range::above(0.5).text(), "above 0.5");
  EXPECT_EQ(Range::between(0, 1).text(), "from 0 to 1");
  EXPECT_EQ(Range::halfOpen(0, 1).text(), "from 0 to below 1");
  EXPECT_EQ((Range{-HUGE_VAL, 3}.text()), "at most 3");
  EXPECT_EQ((Range{0, 1, true, true}.text()), "above 0 to below 1");
}

TEST(Settings, ListedStandInTheirOrder) {
  const YAML::Node map =
      YAML::Load("{b: {y: 1, x: {w: [2, 3], empty: {}}}, b.z: dotted, a: , c: word}");
  EXPECT_EQ(listedSettings(map), (ListedSettings{{"b.y", "1"},
                                                 {"b.x.w", "[2, 3]"},
                                                 {"b.x.empty", "{}"},
                                                 {"b.z", "dotted"},
                                                 {"a", "~"},
                                                 {"c", "word"}}));
  EXPECT_EQ(flatSettings(map).at("b.x.w"), "[2, 3]");
}

TEST(Settings, TakeTheLastPartsOfLongKeys) {
  double one = 1, other = 2;
  Settings settings;
  settings.bind("environment.rewards.near.weight", one, "a");
  settings.bind("environment.rewards.far.weight", other, "b");
  settings.assign("near.weight:=5");
  EXPECT_EQ(one, 5);
  EXPECT_EQ(settings.text("rewards.far.weight", "a test"), "2");
  EXPECT_EQ(errorOf([&] { settings.assign("weight:=5"); }),
            "setting 'weight' is ambiguous: write one of environment.rewards.near.weight, "
            "environment.rewards.far.weight.");
  EXPECT_NE(errorOf([&] { settings.assign("ear.weight:=5"); }), "(no error)");
}

}  // namespace
}  // namespace pmeta
