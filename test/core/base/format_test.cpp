#include "pmeta_core/base/format.h"

#include <gtest/gtest.h>

#include <limits>
#include <locale>

#include "../german_locale.h"

namespace pmeta {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Format, ShortNumbersHaveTwoDecimals) {
  EXPECT_EQ(shortNumber(-14.442976), "-14.44");
  EXPECT_EQ(shortNumber(0.005001), "0.01");
  EXPECT_EQ(shortNumber(-0.001), "0.00") << "no minus before zero";
  EXPECT_EQ(shortNumber(99999), "99999.00");
  EXPECT_EQ(shortNumber(-123456), "-1.23e+05");
  EXPECT_EQ(shortNumber(kNan), "-");
  EXPECT_EQ(shortNumber(kInfinity), "-");
}

TEST(Format, SignificantDigitsAreThoseOfPrintf) {
  for (const double value :
       {0.0, 1.0, -0.000123456, 31.41592653, 1e5, 123456.7, 1e-300, kInfinity}) {
    for (const int digits : {2, 4}) {
      char text[32];
      std::snprintf(text, sizeof text, "%.*g", digits, value);
      EXPECT_EQ(significant(value, digits), text);
    }
  }
  EXPECT_EQ(significant(kNan, 2), "-");
}

TEST(Format, CountsHaveThreeDigitsAndAUnit) {
  EXPECT_EQ(shortCount(0), "0");
  EXPECT_EQ(shortCount(12.34), "12.3");
  EXPECT_EQ(shortCount(999.4), "999");
  EXPECT_EQ(shortCount(999.6), "1k");
  EXPECT_EQ(shortCount(12345), "12.3k");
  EXPECT_EQ(shortCount(4.56e6), "4.56M");
  EXPECT_EQ(shortCount(7.8e9), "7.8G");
  EXPECT_EQ(shortCount(1.5e12), "1.5e+03G");
  EXPECT_EQ(shortCount(kNan), "-");
}

TEST(Format, DurationsAreInSecondsMinutesOrHours) {
  EXPECT_EQ(duration(0), "0:00:00");
  EXPECT_EQ(duration(4.21), "0:00:04");
  EXPECT_EQ(duration(65.4), "0:01:05");
  EXPECT_EQ(duration(3599.6), "1:00:00");
  EXPECT_EQ(duration(360007), "100:00:07");
  EXPECT_EQ(duration(kNan), "-");
}

TEST(Format, PaddedTextHasItsWidthOnEitherSide) {
  EXPECT_EQ(padded("ab", 4), "ab  ");
  EXPECT_EQ(padded("ab", 4, true), "  ab");
  EXPECT_EQ(padded("abcd", 4), "abcd");
  EXPECT_EQ(padded("abcde", 4), "abcde");
}

// a C++ locale that writes "1.234,5"
struct Comma : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST(Format, ShowsStrangersTextWithoutObeyingIt) {
  EXPECT_EQ(shown("grid_4x4"), "'grid_4x4'");
  EXPECT_EQ(shown("a\x1b[31mb\n\x7f"),
            "'a?[31mb?"
            "?'");
  EXPECT_EQ(shown("caf\xc3\xa9 \xe6\x97\xa5"), "'caf\xc3\xa9 \xe6\x97\xa5'");
  EXPECT_EQ(shown("\xc2\x9b"
                  "31m"),
            "'?31m'")
      << "U+009B begins a sequence as ESC [ does";
  EXPECT_EQ(shown("a\xff"
                  "b\xc0\xaf"),
            "'a?b?"
            "?'");
  EXPECT_EQ(shown(std::string(60, 'x')), "'" + std::string(60, 'x') + "'");
  EXPECT_EQ(shown(std::string(10000000, 'x')), "'" + std::string(60, 'x') + "...'");
  EXPECT_EQ(shown(std::string(59, 'x') + "\xc3\xa9"), "'" + std::string(59, 'x') + "...'");
}

TEST(Format, PlainTextIsUtf8WithoutControlCharacters) {
  for (const char* good : {"", "a b", "caf\xc3\xa9", "\xf0\x9f\xa4\x96"}) {
    EXPECT_TRUE(isPlainText(good)) << good;
  }
  for (const char* bad : {"a\nb", "\x1b", "\x7f", "\xff", "\xc3", "\xc0\xaf", "\xed\xa0\x80",
                          "\xf4\x90\x80\x80", "\xe0\x80\xaf", "\xc2\x85"}) {
    EXPECT_FALSE(isPlainText(bad)) << shown(bad);
  }
}

TEST(Format, HasDotsWhateverTheCLocaleIs) {
  const test::GermanLocale locale;
  if (!locale.available()) GTEST_SKIP() << "no localedef, or no locale de_DE";
  EXPECT_EQ(
      shortNumber(-3.5) + " " + significant(0.25, 2) + " " + shortCount(1500) + " " + duration(4.2),
      "-3.50 0.25 1.5k 0:00:04");
}

}  // namespace
}  // namespace pmeta
