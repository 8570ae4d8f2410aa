#include "pmeta_core/nn/gemm.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "pmeta_core/base/rng.h"

namespace pmeta {
namespace {

using Path = decltype(&gemm);

std::vector<float> noise(std::size_t n, std::uint64_t seed) {
  Rng rng(seed, n, Stream::kMeasure);
  std::vector<float> values(n);
  for (float& value : values) value = static_cast<float>(2 * rng.uniform() - 1);
  return values;
}

// rows further apart than they are long, and pointers that no alignment helps
struct Case {
  Case(bool ta, bool tb, std::size_t m, std::size_t n, std::size_t k)
      : ta(ta), tb(tb), m(m), n(n), k(k) {
    lda = (ta ? m : k) + 3;
    ldb = (tb ? k : n) + 1;
    ldc = n + 2;
    a = noise(1 + (ta ? k : m) * lda, 1);
    b = noise(1 + (tb ? n : k) * ldb, 2);
    c = noise(1 + m * ldc, 3);
  }

  std::vector<float> run(Path path, float alpha, float beta) const {
    std::vector<float> result = c;
    const auto transpose = [](bool yes) { return yes ? Transpose::kYes : Transpose::kNo; };
    path(transpose(ta), transpose(tb), m, n, k, alpha, a.data() + 1, lda, b.data() + 1, ldb, beta,
         result.data() + 1, ldc);
    return result;
  }

  std::vector<double> reference(double alpha, double beta) const {
    std::vector<double> result(c.begin(), c.end());
    for (std::size_t i = 0; i < m; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        double sum = 0;
        for (std::size_t l = 0; l < k; ++l) {
          const double left = a[1 + (ta ? l * lda + i : i * lda + l)];
          const double right = b[1 + (tb ? j * ldb + l : l * ldb + j)];
          sum += left * right;
        }
        double& entry = result[1 + i * ldc + j];
        entry = alpha * sum + beta * entry;
      }
    }
    return result;
  }

  bool ta, tb;
  std::size_t m, n, k, lda, ldb, ldc;
  std::vector<float> a, b, c;
};

std::size_t threadCount() {
  std::size_t count = 0;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    count += task.path().empty() ? 0 : 1;
  }
  return count;
}

class GemmPath : public ::testing::TestWithParam<Path> {};
INSTANTIATE_TEST_SUITE_P(Both, GemmPath, ::testing::Values(&gemm, &gemmEigen));

TEST_P(GemmPath, IsTheProductAndTouchesNothingElse) {
  const std::vector<std::tuple<std::size_t, std::size_t, std::size_t>> sizes = {
      {1, 1, 1}, {5, 7, 3}, {64, 33, 4}, {64, 2, 65}, {3, 130, 64}, {1, 40, 50}, {17, 1, 9}};
  for (const auto& [m, n, k] : sizes) {
    for (int transposes = 0; transposes < 4; ++transposes) {
      const Case one(transposes & 1, transposes & 2, m, n, k);
      for (const auto& [alpha, beta] : {std::pair{1.0, 0.0}, {1.0, 1.0}, {-0.5, 2.0}}) {
        const auto found = one.run(GetParam(), static_cast<float>(alpha), static_cast<float>(beta));
        const auto expected = one.reference(alpha, beta);
        for (std::size_t i = 0; i < found.size(); ++i) {
          ASSERT_NEAR(found[i], expected[i], 2e-6 * std::sqrt(double(k)) + 1e-6)
              << m << "x" << n << "x" << k << " transposes " << transposes << " at " << i;
        }
      }
    }
  }
}

TEST_P(GemmPath, WithoutBetaItDoesNotReadC) {
  Case one(false, true, 6, 9, 5);
  const auto clean = one.run(GetParam(), 1, 0);
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 9; ++j) {
      one.c[1 + i * one.ldc + j] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  const auto found = one.run(GetParam(), 1, 0);
  EXPECT_EQ(0, std::memcmp(found.data(), clean.data(), found.size() * sizeof(float)));
}

TEST_P(GemmPath, GivesTheSameBitsEveryTime) {
  const Case one(false, true, 64, 200, 150);
  const auto first = one.run(GetParam(), 1, 0);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(one.run(GetParam(), 1, 0), first);
  std::vector<float> elsewhere;
  std::thread([&] { elsewhere = one.run(GetParam(), 1, 0); }).join();
  EXPECT_EQ(elsewhere, first);
}

TEST(Gemm, PathsAgreeAtTheSizesOfANetwork) {
  for (int transposes = 0; transposes < 4; ++transposes) {
    const Case one(transposes & 1, transposes & 2, 64, 256, 512);
    const auto a = one.run(&gemm, 1, 0), b = one.run(&gemmEigen, 1, 0);
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-4) << i;
  }
}

TEST(Gemm, RunsOnTheCallingThreadWhateverOpenMpIsTold) {
  // OpenMP is there only if oneDNN brought it
  const auto tell = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "omp_set_num_threads"));
  const auto ask = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "omp_get_max_threads"));
  const int told = ask == nullptr ? 0 : ask();
  if (tell != nullptr) tell(4);
  const std::size_t before = threadCount();
  const Case one(false, false, 256, 256, 256);
  one.run(&gemm, 1, 0);
  EXPECT_EQ(threadCount(), before);
  if (tell != nullptr && ask != nullptr) {
    EXPECT_EQ(ask(), 4) << "the caller's own setting must stay";
    tell(told);
  }
}

TEST(Gemm, NamesItself) {
  const std::string name = gemmName();
  EXPECT_TRUE(name.rfind("oneDNN ", 0) == 0 || name.rfind("Eigen ", 0) == 0) << name;
}

}  // namespace
}  // namespace pmeta
