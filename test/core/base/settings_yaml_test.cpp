#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "../support.h"
#include "sample_settings.h"

namespace pmeta {
namespace {

using test::errorOf;
using Sample = test::SampleSettings;

TEST(Settings, YamlOfTheDefaultsIsAsExpected) {
  EXPECT_EQ(Sample().settings.yaml(),
            "title: demo\nrounds: 10\nseed: 0\nverbose: true\npersonal:\n  lambda: 10\n  init: "
            "meta\n  rate: 0.1\nq_learning:\n  rate: 0.2\n  gamma: 0.9\n  offset: "
            "0\nenvironment:\n  sizes: [4, 5]\n  slip: [0]\n  labels: [a]\n  corners: [left]\n  "
            "any: [0]\n");
}

void expectTextRoundTrip(const std::string& text) {
  Sample s;
  s.title = text;
  s.labels = {text, "plain", text};
  Sample back;
  ASSERT_EQ(errorOf([&] { back.read(s.settings.yaml()); }), "(no error)") << s.settings.yaml();
  EXPECT_EQ(back.title, s.title) << s.settings.yaml();
  EXPECT_EQ(back.labels, s.labels) << s.settings.yaml();
  EXPECT_EQ(back.settings.yaml(), s.settings.yaml());
}

TEST(Settings, YamlRoundTripsAwkwardTexts) {
  for (const std::string text :
       {"",     " ",        "true",  "false", "yes",  "no",   "null",       "Null",
        "NULL", "~",        "~/x",   "1.5",   "1e5",  "0x10", "nan",        ".inf",
        "a: b", "a:b",      "a #b",  "#a",    "a, b", "[a]",  "{a}",        "a]",
        "a}",   "]",        "- a",   "-",     "--",   "---",  "...",        "?",
        "? a",  ":",        "a:",    "!a",    "&a",   "*a",   "%a",         "@a",
        "`a",   "|",        ">",     "'",     "\"",   "it's", "say \"hi\"", "back\\slash",
        "\\n",  "a\nb",     "a\tb",  "\ta",   " a",   "a ",   "Zürich",     "日本",
        "🙂", "/tmp/a b", "C:\\x", "<<",    "=",    ",",    ",a",         "a,"}) {
    expectTextRoundTrip(text);
  }
}

TEST(Settings, YamlRoundTripsRandomTexts) {
  std::mt19937 random(1);
  const std::string alphabet = "ab01 .,:;-#[]{}'\"\\!&*?|>%@`~=<\n\t/_";
  for (int i = 0; i < 1500 && !HasFailure(); ++i) {
    std::string text(random() % 6, ' ');
    for (char& c : text) c = alphabet[random() % alphabet.size()];
    expectTextRoundTrip(text);
  }
}

TEST(Settings, YamlRoundTripsAwkwardNumbers) {
  const std::vector<double> numbers = {0.1,
                                       1e-300,
                                       1e22,
                                       0,
                                       1.0 / 3,
                                       5e-324,
                                       123456789,
                                       1e15,
                                       2.5e-5,
                                       1e300,
                                       0.3,
                                       1e6,
                                       1e-7,
                                       std::nextafter(0.1, 1),
                                       9007199254740993.0};
  for (const double number : numbers) {
    Sample s;
    s.lambda = number;
    s.q_rate = -number;
    Sample back;
    back.read(s.settings.yaml());
    EXPECT_EQ(back.lambda, s.lambda);
    EXPECT_EQ(back.q_rate, s.q_rate);
    EXPECT_EQ(back.settings.yaml(), s.settings.yaml());
  }
}

TEST(Settings, YamlRoundTripsIntegersAndFlags) {
  Sample s;
  s.seed = std::numeric_limits<std::int64_t>::max();
  s.offset = std::numeric_limits<int>::min();
  s.verbose = false;
  s.sizes = {512, 2, 3};
  s.slip = {0.1, 0, 0.9999999999999999};
  Sample back;
  back.read(s.settings.yaml());
  EXPECT_EQ(back.seed, s.seed);
  EXPECT_EQ(back.offset, s.offset);
  EXPECT_EQ(back.verbose, s.verbose);
  EXPECT_EQ(back.sizes, s.sizes);
  EXPECT_EQ(back.slip, s.slip);
}

TEST(Settings, ASecondDocumentIsRefused) {
  EXPECT_EQ(
      errorOf([] { parseYaml("a: 1\n---\nb: 5\n", "y.yaml"); }),
      "y.yaml line 3 is in a second YAML document, which is not read: remove the '---' before "
      "it.");
  EXPECT_EQ(errorOf([] { parseYaml("---\na: 1\n", "y.yaml"); }), "(no error)");
  EXPECT_EQ(errorOf([] { parseYaml("", "y.yaml"); }),
            "y.yaml must hold settings as 'key: value' lines.");
}

TEST(Settings, YamlReadsBackWhereAGroupIsBoundInTwoParts) {
  double a = 1, b = 2, c = 3;
  Settings settings;
  settings.bind("left.a", a, "");
  settings.bind("right.b", b, "");
  settings.bind("left.c", c, "");
  c = 7;
  const std::string yaml = settings.yaml();
  c = 0;
  EXPECT_EQ(errorOf([&] { settings.read(parseYaml(yaml, "y"), "y"); }), "(no error)") << yaml;
  EXPECT_EQ(c, 7);
}

TEST(Settings, TableMarksDefaultsAndAlignsValues) {
  double rate = 0.1;
  std::string word = "x";
  Settings settings;
  settings.bind("group.rate", rate, "the step", Range::above(0));
  settings.bind("word", word, "a word");
  word = "y";
  EXPECT_EQ(settings.table(), "  group.rate  0.1  (default)\n  word        y\n");
  EXPECT_EQ(settings.table(true),
            "  group.rate  0.1  (default)\n              the step [a number, above 0]\n"
            "  word        y  (default: x)\n              a word [text]\n");
}

TEST(FormatNumber, ReadsBackExactly) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t bits = random();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) continue;
    ASSERT_EQ(std::strtod(formatNumber(value).c_str(), nullptr), value);
  }
}

TEST(FormatNumber, IsShort) {
  EXPECT_EQ(formatNumber(0.1), "0.1");
  EXPECT_EQ(formatNumber(0), "0");
  EXPECT_EQ(formatNumber(-2.5), "-2.5");
  EXPECT_EQ(formatNumber(100000), "100000");
  EXPECT_EQ(formatNumber(1e22), "1e+22");
  EXPECT_EQ(formatNumber(0.30000000000000004), "0.30000000000000004");
  EXPECT_EQ(formatNumber(1.0 / 3), "0.3333333333333333");
}

}  // namespace
}  // namespace pmeta
