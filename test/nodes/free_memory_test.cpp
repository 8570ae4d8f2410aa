#include "common/free_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstddef>
#include <cstring>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

namespace pmeta_nodes {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;  // with an allocator of its own
#else
constexpr bool kSanitized = false;
#endif

long faults() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt;
}

std::size_t resident() {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0, pages = 0;
  statm >> size >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

// as many copies of a model as a round has at a time, written and freed again
void copyModels(std::size_t bytes) {
  std::vector<std::unique_ptr<char[]>> copies(6);
  for (auto& copy : copies) {
    copy.reset(new char[bytes]);
    std::memset(copy.get(), 1, bytes);
  }
}

// page faults of a hundred rounds with copies of a model, after a first one
long faultsOfRounds(std::size_t bytes) {
  copyModels(bytes);
  const long before = faults();
  for (int round = 0; round < 100; ++round) copyModels(bytes);
  return faults() - before;
}

class FreeMemory : public testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized) GTEST_SKIP() << "the sanitizer's allocator knows no thresholds";
    boundFreeMemory();
  }
};

TEST_F(FreeMemory, CopiesOfASmallModelTakeNoNewPagesFromTheSystem) {
  const std::size_t bytes = 280000;
  // in a thread too, which has a heap of its own
  long in_thread = 0;
  std::thread([&] { in_thread = faultsOfRounds(bytes); }).join();
  EXPECT_LT(faultsOfRounds(bytes), 100);
  EXPECT_LT(in_thread, 100);
}

TEST_F(FreeMemory, LargeModelsGoBackToTheSystem) {
  const std::size_t bytes = 4000000;
  const std::size_t before = resident();
  auto model = std::make_unique<std::vector<char>>(bytes);
  EXPECT_GT(resident(), before + bytes / 2);
  model.reset();
  EXPECT_LT(resident(), before + bytes / 2);
}

}  // namespace
}  // namespace pmeta_nodes
