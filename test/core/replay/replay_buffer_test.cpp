#include "pmeta_core/replay/replay_buffer.h"

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <fstream>
#include <string>

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

double residentMegabytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

TEST(ReplayBuffer, MemoryBecomesResidentAsTransitionsArrive) {
  const double before = residentMegabytes();
  ReplayBuffer buffer(2000000, 3, 2);  // 80 MB when full
  const float* values = buffer.values().data();
  for (int k = 0; k < 1000; ++k) buffer.add(Sample(k).view());
  EXPECT_LT(residentMegabytes() - before, 8);
  for (int k = 0; k < 2000000; ++k) buffer.add(Sample(k).view());
  EXPECT_LT(residentMegabytes() - before, 90);
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
