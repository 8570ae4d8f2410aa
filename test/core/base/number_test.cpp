#include "pmeta_core/base/number.h"

#include <gtest/gtest.h>

#include "../german_locale.h"
#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

TEST(Number, IsTheWholeTextInDecimalDigits) {
  double value = 0;
  EXPECT_TRUE(parseNumber("-1.5e3", value));
  EXPECT_EQ(value, -1500);
  for (const char* text : {"", " 1", "1 ", "1,5", "0x1", "nan", "inf", "1e999", "1.5.2", "--1"}) {
    EXPECT_FALSE(parseNumber(text, value)) << text;
  }
}

TEST(Number, HasADotWhateverTheLocaleIs) {
  const test::GermanLocale locale;
  if (!locale.available()) GTEST_SKIP() << "no localedef, or no locale de_DE";
  double value = 0;
  EXPECT_TRUE(parseNumber("0.001", value));
  EXPECT_EQ(value, 0.001);
  EXPECT_FALSE(parseNumber("0,001", value));
  EXPECT_EQ(formatNumber(0.1 + 0.2), "0.30000000000000004");
  EXPECT_EQ(CsvTable::parse("a\n2.5\n", "a.csv").number(0, 0), 2.5);
  const Experiment experiment = test::gridExperiment({"alpha:=0.001", "slip:=[0.125]"});
  EXPECT_EQ(experiment.settings().personal.alpha, 0.001);
  EXPECT_NE(experiment.yaml().find("slip: [0.125]"), std::string::npos);
  // C's own functions go on in the process's locale
  char text[8];
  std::snprintf(text, sizeof text, "%.1f", 0.5);
  EXPECT_STREQ(text, "0,5");
}

}  // namespace
}  // namespace pmeta
