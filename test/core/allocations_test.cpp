#include "allocations.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "pmeta_core/nn/aligned.h"

namespace {

std::atomic<std::size_t> count{0};

void* allocate(std::size_t n, std::size_t alignment) {
  ++count;
  void* p = std::aligned_alloc(alignment, (n + alignment) / alignment * alignment);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

}  // namespace

// every other form of operator new ends in the first two, but under a sanitizer, which has its own
void* operator new(std::size_t n) { return allocate(n, alignof(std::max_align_t)); }
void* operator new(std::size_t n, std::align_val_t alignment) {
  return allocate(n, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t n, const std::nothrow_t&) noexcept {
  ++count;
  return std::malloc(n);
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace pmeta::test {

std::size_t allocations() { return count; }

TEST(Allocations, AreCounted) {
  const std::size_t before = allocations();
  const std::vector<int> plain(10);
  const AlignedFloats aligned(10);
  ASSERT_EQ(plain.size(), aligned.size());
  EXPECT_EQ(allocations() - before, 2u)
      << "another test file replaces operator new: it should use allocations.h";
}

}  // namespace pmeta::test
