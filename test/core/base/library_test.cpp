#include "pmeta_core/base/library.h"

#include <gtest/gtest.h>

#include "../support.h"

namespace pmeta {
namespace {

TEST(Misfit, SaysWhatALibraryWasCompiledWithThatDoesNotFit) {
  EXPECT_EQ(misfit(kThisBuild), "");
  Build build = kThisBuild;
  build.version = "9.1.0";
  build.interface = 7;
  EXPECT_EQ(misfit(build), "it was built against pMeta 9.1.0 with interface 7, and this is " +
                               std::string(kVersion) + " with interface " +
                               std::to_string(kInterface) + ": build it against this one");
  build = kThisBuild;
  build.alignment *= 2;
  EXPECT_NE(misfit(build).find("give both the same -march"), std::string::npos);
  build = kThisBuild;
  build.checks_containers = true;
  EXPECT_NE(misfit(build).find("with -D_GLIBCXX_DEBUG"), std::string::npos);
  build = kThisBuild;
  build.fast_math = true;
  EXPECT_NE(misfit(build).find("-ffast-math"), std::string::npos);
}

TEST(Registered, TakesNoRowThatDoesNotFitOrWhoseNameIsTaken) {
  Registry<int> numbers("number");
  const Registered<int> one(numbers, "one", 1);
  EXPECT_THROW(Registered<int>(numbers, "one", 2), std::logic_error);
  Build build = kThisBuild;
  build.package = "my_package";
  build.package_version = "1.2.0";
  const Registered<int> two(numbers, "my_package/two", 2, build);
  build.interface = 0;
  EXPECT_THROW(Registered<int>(numbers, "three", 3, build), std::logic_error);
  EXPECT_EQ(numbers.names(), (std::vector<std::string>{"my_package/two", "one"}));
  EXPECT_EQ(numbers.at("one"), 1);
  EXPECT_EQ(numbers.package("one").name, "");
  EXPECT_EQ(numbers.package("my_package/two").version, "1.2.0");
}

}  // namespace
}  // namespace pmeta
