#include "pmeta_core/base/names.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pmeta {
namespace {

TEST(Nearest, FindsTheClosestWordOrNone) {
  const std::vector<std::string> words = {"alpha", "lambda", "eta", "personal_init"};
  EXPECT_EQ(nearest("alfa", words), "alpha");
  EXPECT_EQ(nearest("lamda", words), "lambda");
  EXPECT_EQ(nearest("lambda", words), "lambda");
  EXPECT_EQ(nearest("etta", words), "eta");
  EXPECT_EQ(nearest("lambad", words), "lambda");
  EXPECT_EQ(nearest("personalinit", words), "personal_init");
  EXPECT_EQ(nearest("momentum", words), "");
  EXPECT_EQ(nearest("alpha", {}), "");
}

// edit distance by its recursive definition
std::size_t plainDistance(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return a.size() + b.size();
  const std::size_t keep = plainDistance(a.substr(1), b.substr(1)) + (a[0] != b[0]);
  return std::min({keep, plainDistance(a.substr(1), b) + 1, plainDistance(a, b.substr(1)) + 1});
}

TEST(Nearest, AgreesWithThePlainEditDistance) {
  std::mt19937 random(3);
  const auto word = [&] {
    std::string text(1 + random() % 5, 'a');
    for (char& c : text) c = static_cast<char>('a' + random() % 3);
    return text;
  };
  for (int i = 0; i < 300; ++i) {
    const std::string a = word(), b = word();
    // short words are close at two edits
    EXPECT_EQ(nearest(a, {b}), plainDistance(a, b) <= 2 ? b : "") << a << " " << b;
  }
}

TEST(Join, PutsSeparatorsBetweenWords) {
  EXPECT_EQ(join({}), "");
  EXPECT_EQ(join({"a"}), "a");
  EXPECT_EQ(join({"a", "b", "c"}), "a, b, c");
  EXPECT_EQ(join({"a", "b"}, "/"), "a/b");
  EXPECT_EQ(join({"", "b"}), ", b");
}

TEST(NearestFirst, KeepsTheOrderOfThoseThatAreAsFar) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(nearestFirst("tip", {"elbow", "trip", "tip_2", "tap"}),
            (Names{"trip", "tap", "tip_2", "elbow"}));
  EXPECT_EQ(nearestFirst("", {"b", "a"}), (Names{"b", "a"}));
  EXPECT_EQ(nearestFirst("x", {}), Names{});
}

TEST(UnknownName, ListsTheKnownAndTheNearest) {
  EXPECT_EQ(unknownName("rule", "medin", {"mean", "median"}),
            "unknown rule 'medin': did you mean 'median'? Known are mean, median.");
  EXPECT_EQ(unknownName("rule", "vote", {"mean", "median"}),
            "unknown rule 'vote'. Known are mean, median.");
  EXPECT_EQ(unknownName("rule", "a\nb", {"mean"}), "unknown rule 'a?b'. Known are mean.");
}

}  // namespace
}  // namespace pmeta
