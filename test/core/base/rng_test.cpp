#include "pmeta_core/base/rng.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bitset>
#include <cmath>
#include <set>
#include <tuple>
#include <vector>

#include "../support.h"

namespace pmeta {
namespace {

using State = std::array<std::uint64_t, 4>;
using test::chiSquare;

constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ULL;

// splitmix64 as its authors print it: a counter and a finaliser
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t x) : x_(x) {}
  std::uint64_t next() {
    std::uint64_t z = (x_ += kGolden);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t x_;
};

// inverse of an odd number modulo 2^64, by Newton's iteration
std::uint64_t inverse(std::uint64_t odd) {
  std::uint64_t x = odd;
  for (int i = 0; i < 6; ++i) x *= 2 - odd * x;
  return x;
}

std::uint64_t undoXorShift(std::uint64_t y, int shift) {
  std::uint64_t x = y;
  for (int done = shift; done < 64; done += shift) x = y ^ (x >> shift);
  return x;
}

// the counter before the step whose output was z
std::uint64_t unmix(std::uint64_t z) {
  z = undoXorShift(z, 31) * inverse(0x94d049bb133111ebULL);
  z = undoXorShift(z, 27) * inverse(0xbf58476d1ce4e5b9ULL);
  return undoXorShift(z, 30) - kGolden;
}

// xoshiro256++ on bit sets, so that no line is shared with the library
std::uint64_t stepOnBits(State& state) {
  using Bits = std::bitset<64>;
  const auto rotate = [](Bits x, int k) { return (x << k) | (x >> (64 - k)); };
  Bits s0(state[0]), s1(state[1]), s2(state[2]), s3(state[3]);
  const std::uint64_t result = rotate(Bits(state[0] + state[3]), 23).to_ullong() + state[0];
  const Bits n2 = s2 ^ s0;
  const Bits n3 = s3 ^ s1;
  state = {(s0 ^ n3).to_ullong(), (s1 ^ n2).to_ullong(), (n2 ^ (s1 << 17)).to_ullong(),
           rotate(n3, 45).to_ullong()};
  return result;
}

TEST(Rng, ExpansionGivesThePublishedSplitmixValues) {
  // the seed whose chain of hashes ends at the published state 1234567
  const std::uint64_t task = 3, round = 7;
  std::uint64_t seed = unmix(1234567) ^ round;
  seed = unmix(seed) ^ static_cast<std::uint64_t>(Stream::kSample);
  seed = unmix(unmix(seed) ^ task);
  const State published = {6457827717110365317ULL, 3203168211198807973ULL, 9817491932198370423ULL,
                           4593380528125082431ULL};
  EXPECT_EQ(Rng(seed, task, Stream::kSample, round).state(), published);

  SplitMix reference(1234567);
  for (const std::uint64_t word : published) EXPECT_EQ(reference.next(), word);
  EXPECT_EQ(reference.next(), 16408922859458223821ULL);
}

TEST(Rng, ExpansionChainsTheWholeKey) {
  for (const std::uint64_t seed : {0ULL, 1ULL, 42ULL, ~0ULL}) {
    std::uint64_t key = SplitMix(seed).next();
    for (const std::uint64_t part : {std::uint64_t{5}, std::uint64_t{2}, std::uint64_t{9}}) {
      key = SplitMix(key ^ part).next();
    }
    SplitMix words(key);
    const State state = Rng(seed, 5, Stream::kInitialise, 9).state();
    for (const std::uint64_t word : state) EXPECT_EQ(word, words.next());
  }
}

TEST(Rng, StepGivesThePublishedXoshiroValues) {
  Rng rng(0, 0, Stream::kMeasure);
  rng.setState({1, 2, 3, 4});
  for (const std::uint64_t value :
       {41943041ULL, 58720359ULL, 3588806011781223ULL, 3591011842654386ULL, 9228616714210784205ULL,
        9973669472204895162ULL, 14011001112246962877ULL, 12406186145184390807ULL,
        15849039046786891736ULL, 10450023813501588000ULL}) {
    EXPECT_EQ(rng(), value);
  }
}

TEST(Rng, StepFollowsTheReferenceForLong) {
  Rng rng(17, 2, Stream::kCollect, 5);
  State state = rng.state();
  for (int i = 0; i < 20000; ++i) ASSERT_EQ(rng(), stepOnBits(state)) << "draw " << i;
  EXPECT_EQ(rng.state(), state);
}

TEST(Rng, EveryKeyHasItsOwnStream) {
  std::set<State> states;
  std::set<std::uint64_t> first_draws;
  int keys = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    for (std::uint64_t task = 0; task < 10; ++task) {
      for (int stream = 1; stream <= 6; ++stream) {
        for (std::uint64_t round = 0; round < 10; ++round, ++keys) {
          Rng rng(seed, task, static_cast<Stream>(stream), round);
          states.insert(rng.state());
          first_draws.insert(rng());
        }
      }
    }
  }
  EXPECT_EQ(states.size(), static_cast<std::size_t>(keys));
  EXPECT_EQ(first_draws.size(), static_cast<std::size_t>(keys));
}

TEST(Rng, NeighbouringStreamsAreUncorrelated) {
  Rng a(1, 0, Stream::kSample, 1), b(1, 1, Stream::kSample, 1), c(1, 0, Stream::kSample, 2);
  const int n = 100000;
  double ab = 0, ac = 0;
  for (int i = 0; i < n; ++i) {
    const double x = a.uniform() - 0.5;
    ab += x * (b.uniform() - 0.5);
    ac += x * (c.uniform() - 0.5);
  }
  const double sigma = std::sqrt(static_cast<double>(n)) / 12;
  EXPECT_LT(std::abs(ab), 4 * sigma);
  EXPECT_LT(std::abs(ac), 4 * sigma);
}

TEST(Rng, UniformIsTheTopBitsAsAFraction) {
  Rng rng(3, 0, Stream::kMeasure);
  Rng bits = rng;
  double sum = 0, squares = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const double x = rng.uniform();
    ASSERT_GE(x, 0);
    ASSERT_LT(x, 1);
    ASSERT_EQ(std::ldexp(x, 53), static_cast<double>(bits() / 2048));
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / n, 0.5, 4 * std::sqrt(1.0 / 12 / n));
  EXPECT_NEAR(squares / n, 1.0 / 3, 4 * std::sqrt(4.0 / 45 / n));
}

TEST(Rng, UniformNeverReachesOne) {
  Rng rng(0, 0, Stream::kMeasure);
  // rotl(s0 + s3, 23) + s0 is all ones here
  rng.setState({0, 1, 1, ~0ULL});
  EXPECT_EQ(rng.uniform(), 1 - std::ldexp(1.0, -53));
}

TEST(Rng, BelowStaysBelowAndIsUniform) {
  Rng rng(11, 0, Stream::kMeasure);
  // 99.99 % quantiles of chi-square with n - 1 degrees of freedom
  const std::vector<std::pair<int, double>> cases = {
      {2, 15.14}, {3, 18.42}, {7, 27.86}, {10, 33.72}, {64, 112.5}};
  for (const auto& [n, quantile] : cases) {
    std::vector<int> counts(n, 0);
    for (int i = 0; i < 20000; ++i) {
      const std::uint64_t x = rng.below(n);
      ASSERT_LT(x, static_cast<std::uint64_t>(n));
      ++counts[x];
    }
    EXPECT_LT(chiSquare(counts), quantile) << "n = " << n;
  }
}

TEST(Rng, BelowIsUnbiasedWhereTheRangeIsNoDivisor) {
  // n = 3 * 2^62: taking the remainder would favour small numbers two to one, and multiply-shift
  // without redrawing would favour multiples of three
  const std::uint64_t n = 3ULL << 62;
  Rng rng(12, 0, Stream::kMeasure);
  std::vector<int> thirds(3, 0), residues(3, 0);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t x = rng.below(n);
    ASSERT_LT(x, n);
    ++thirds[x >> 62];
    ++residues[x % 3];
  }
  EXPECT_LT(chiSquare(thirds), 18.42);
  EXPECT_LT(chiSquare(residues), 18.42);
}

TEST(Rng, BelowOneIsZeroAndBelowTheLargestStaysBelow) {
  Rng rng(13, 0, Stream::kMeasure);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(rng.below(1), 0u);
    EXPECT_LT(rng.below(~0ULL), ~0ULL);
  }
}

TEST(Rng, NormalHasTheMomentsAndTheDistribution) {
  Rng rng(5, 0, Stream::kMeasure);
  const int n = 100000;
  std::vector<double> x(n);
  double moments[5] = {};
  for (double& value : x) {
    value = rng.normal();
    for (int p = 1; p <= 4; ++p) moments[p] += std::pow(value, p) / n;
  }
  const double root = std::sqrt(static_cast<double>(n));
  EXPECT_NEAR(moments[1], 0, 4 / root);
  EXPECT_NEAR(moments[2], 1, 4 * std::sqrt(2) / root);
  EXPECT_NEAR(moments[3], 0, 4 * std::sqrt(15) / root);
  EXPECT_NEAR(moments[4], 3, 4 * std::sqrt(96) / root);

  // Kolmogorov and Smirnov, at 0.01 %
  std::sort(x.begin(), x.end());
  double gap = 0;
  for (int i = 0; i < n; ++i) {
    const double cdf = 0.5 * std::erfc(-x[i] / std::sqrt(2));
    gap = std::max({gap, std::abs(cdf - i / double(n)), std::abs(cdf - (i + 1) / double(n))});
  }
  EXPECT_LT(gap * root, 2.23);
}

TEST(Rng, StateRestoresEveryDistribution) {
  Rng rng(8, 1, Stream::kCollect, 2);
  // an odd number of normals: a generator that kept the second one would differ below
  for (int i = 0; i < 3; ++i) rng.normal();
  const State saved = rng.state();
  const auto draw = [](Rng& r) {
    return std::make_tuple(r.normal(), r.below(1000), r.uniform(), r());
  };
  const auto first = draw(rng);
  Rng other(0, 0, Stream::kTaskDraw);
  other.normal();
  other.setState(saved);
  EXPECT_EQ(draw(other), first);
}

}  // namespace
}  // namespace pmeta
