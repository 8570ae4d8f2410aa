#include "pmeta_core/replay/replay_buffer.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "../memory_state.h"
#include "../support.h"

namespace pmeta {
namespace {

// the numbers of the k-th transition, all different
struct Sample {
  explicit Sample(int k) {
    for (int j = 0; j < 3; ++j) observation[j] = 100.0f * k + j;
    for (int j = 0; j < 2; ++j) action[j] = 100.0f * k + 10 + j;
    reward = 100.0f * k + 20;
    discount = 1.0f / (1 + k);
    for (int j = 0; j < 3; ++j) next[j] = 100.0f * k + 30 + j;
  }
  Transition view() const { return {&observation[0], &action[0], reward, discount, &next[0]}; }
  std::array<float, 3> observation, next;
  std::array<float, 2> action;
  float reward, discount;
};

void expectEqual(const Transition& found, const Sample& expected) {
  for (int j = 0; j < 3; ++j) EXPECT_EQ(found.observation[j], expected.observation[j]);
  for (int j = 0; j < 2; ++j) EXPECT_EQ(found.action[j], expected.action[j]);
  EXPECT_EQ(found.reward, expected.reward);
  EXPECT_EQ(found.discount, expected.discount);
  for (int j = 0; j < 3; ++j) EXPECT_EQ(found.next_observation[j], expected.next[j]);
}

TEST(ReplayBuffer, KeepsTheNewestTransitionsAsTheyWere) {
  for (const std::size_t capacity : {1u, 2u, 7u, 40u}) {
    ReplayBuffer buffer(capacity, 3, 2);
    std::deque<int> newest;
    for (int k = 0; k < 30; ++k) {
      EXPECT_EQ(buffer.next(), static_cast<std::size_t>(k) % capacity);
      EXPECT_EQ(buffer.add(Sample(k).view()), static_cast<std::size_t>(k) % capacity);
      newest.push_back(k);
      if (newest.size() > capacity) newest.pop_front();
      ASSERT_EQ(buffer.size(), newest.size());
      for (const int kept : newest) {
        expectEqual(buffer[static_cast<std::size_t>(kept) % capacity], Sample(kept));
      }
    }
    EXPECT_EQ(buffer.values().size(), newest.size() * 10);
  }
}

// of that memory; the whole process has a sanitizer's as well
double residentMegabytes(const float* begin, std::size_t bytes) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t address = reinterpret_cast<std::uintptr_t>(begin);
  const std::size_t first = address / page * page;
  std::vector<unsigned char> pages((address + bytes - first + page - 1) / page);
  EXPECT_EQ(mincore(reinterpret_cast<void*>(first), pages.size() * page, pages.data()), 0);
  const auto resident = std::count_if(pages.begin(), pages.end(), [](int p) { return p & 1; });
  return static_cast<double>(resident) * static_cast<double>(page) / (1 << 20);
}

TEST(ReplayBuffer, MemoryBecomesResidentAsTransitionsArrive) {
  const std::size_t capacity = 2000000, bytes = capacity * 10 * sizeof(float);
  ReplayBuffer buffer(capacity, 3, 2);
  const float* values = buffer.values().data();
  for (int k = 0; k < 1000; ++k) buffer.add(Sample(k).view());
  EXPECT_LT(residentMegabytes(values, bytes), 8);
  for (int k = 0; k < 2000000; ++k) buffer.add(Sample(k).view());
  EXPECT_NEAR(residentMegabytes(values, bytes), 76.3, 0.1) << "full";
  EXPECT_EQ(buffer.values().data(), values) << "reserved once";
}

TEST(ReplayBuffer, GoesOnFromWhatItHandsOut) {
  const auto add = [](ReplayBuffer& buffer, float x) { buffer.add({&x, &x, x, 0.9f, &x}); };
  for (const int count : {0, 3, 5, 8}) {
    ReplayBuffer a(5, 1, 1), b(5, 1, 1);
    for (int i = 0; i < count; ++i) add(a, static_cast<float>(i));
    add(b, 100);
    test::load(b, test::stateOf(a));
    for (int i = 0; i < 3; ++i) {
      add(a, static_cast<float>(10 + i));
      add(b, static_cast<float>(10 + i));
    }
    EXPECT_EQ(a.values(), b.values());
    EXPECT_EQ(a.size(), b.size());
    EXPECT_EQ(a.next(), b.next());
  }
}

TEST(ReplayBuffer, RefusesWhatDoesNotFit) {
  const auto refusal = [](std::size_t values, std::int64_t next) {
    ReplayBuffer buffer(4, 1, 1);
    test::MemoryState state;
    state.set("values", std::vector<float>(values));
    state.set("next", std::vector<std::int64_t>{next});
    return test::errorOf([&] { test::load(buffer, state); });
  };
  EXPECT_EQ(refusal(9, 1),
            "the saved state does not fit this run: values has 9 values, which are no transitions "
            "of 5.");
  EXPECT_EQ(refusal(25, 0),
            "the saved state does not fit this run: values has 25 values but at most 20 have a "
            "place.");
  EXPECT_EQ(refusal(10, 0),
            "the saved state does not fit this run: next is 0 but must be from 2 to 2.");
  EXPECT_EQ(refusal(20, 4),
            "the saved state does not fit this run: next is 4 but must be from 0 to 3.");
  EXPECT_NE(refusal(20, -1), "(no error)");
  EXPECT_EQ(refusal(20, 3), "(no error)");
  EXPECT_EQ(refusal(0, 0), "(no error)");
}

}  // namespace
}  // namespace pmeta
