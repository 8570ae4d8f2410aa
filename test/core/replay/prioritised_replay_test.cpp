#include "pmeta_core/replay/prioritised_replay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace pmeta {
namespace {

void add(PrioritisedReplay& replay, int k) {
  const float observation[2] = {static_cast<float>(k), -static_cast<float>(k)};
  const float action = static_cast<float>(k % 3);
  const float next[2] = {static_cast<float>(k) + 0.5f, 7};
  replay.add({observation, &action, 2.0f * static_cast<float>(k), 0.9f, next});
}

// gives every slot the TD error of its number
void setAll(PrioritisedReplay& replay, const std::vector<float>& td_errors) {
  ReplayBatch all;
  for (std::size_t k = 0; k < td_errors.size(); ++k) all.slots.push_back(k);
  replay.setPriorities(all, td_errors.data());
}

const std::vector<float> kTdErrors = {0.5f, -2, 0, 1e-3f, 8, -0.7f, 3, 1};

PrioritisedReplay filled(double alpha, double beta) {
  PrioritisedReplay replay(8, 2, 1, alpha, beta);
  for (int k = 0; k < 8; ++k) add(replay, k);
  setAll(replay, kTdErrors);
  return replay;
}

TEST(PrioritisedReplay, BatchHoldsTheTransitionsOfItsSlots) {
  PrioritisedReplay replay(10, 2, 1, 0.6, 0.4);
  for (int k = 0; k < 25; ++k) add(replay, k);  // slots hold 20..24, 15..19
  Rng rng(1, 0, Stream::kSample);
  ReplayBatch batch;
  replay.sample(100, rng, batch);
  ASSERT_EQ(batch.slots.size(), 100u);
  for (std::size_t b = 0; b < 100; ++b) {
    const int k = static_cast<int>(batch.slots[b]) + (batch.slots[b] < 5 ? 20 : 10);
    EXPECT_EQ(batch.observations[2 * b], k);
    EXPECT_EQ(batch.observations[2 * b + 1], -k);
    EXPECT_EQ(batch.actions[b], k % 3);
    EXPECT_EQ(batch.rewards[b], 2 * k);
    EXPECT_EQ(batch.discounts[b], 0.9f);
    EXPECT_EQ(batch.next_observations[2 * b], k + 0.5f);
    EXPECT_EQ(batch.next_observations[2 * b + 1], 7);
  }
}

TEST(PrioritisedReplay, DrawsInProportionToPriorityToTheAlpha) {
  for (const double alpha : {0.0, 0.6, 1.0}) {
    const PrioritisedReplay replay = filled(alpha, 0.4);
    double total = 0;
    for (const float td : kTdErrors) total += std::pow(std::abs(td) + 1e-6, alpha);
    Rng rng(2, 0, Stream::kSample);
    ReplayBatch batch;
    std::vector<int> counts(8);
    const int draws = 200000;
    for (int i = 0; i < draws / 100; ++i) {
      replay.sample(100, rng, batch);
      for (const std::size_t slot : batch.slots) ++counts[slot];
    }
    double statistic = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      const double expected = draws * std::pow(std::abs(kTdErrors[k]) + 1e-6, alpha) / total;
      statistic += (counts[k] - expected) * (counts[k] - expected) / expected;
    }
    EXPECT_LT(statistic, 29.9) << "alpha " << alpha;  // 99.99 %, 7 degrees of freedom
  }
}

TEST(PrioritisedReplay, WeightsFollowTheFormula) {
  for (const double beta : {0.0, 0.4, 1.0}) {
    const PrioritisedReplay replay = filled(0.6, beta);
    double total = 0;
    for (const float td : kTdErrors) total += std::pow(std::abs(td) + 1e-6, 0.6);
    Rng rng(3, 0, Stream::kSample);
    ReplayBatch batch;
    for (int i = 0; i < 50; ++i) {
      replay.sample(5, rng, batch);
      std::vector<double> expected;
      for (const std::size_t slot : batch.slots) {
        const double p = std::pow(std::abs(kTdErrors[slot]) + 1e-6, 0.6) / total;
        expected.push_back(std::pow(8 * p, -beta));
      }
      const double largest = *std::max_element(expected.begin(), expected.end());
      for (std::size_t b = 0; b < 5; ++b) {
        EXPECT_NEAR(batch.weights[b], expected[b] / largest, 1e-6);
      }
      EXPECT_EQ(*std::max_element(batch.weights.begin(), batch.weights.end()), 1);
    }
  }
}

TEST(PrioritisedReplay, UniformReplayIgnoresTdErrors) {
  PrioritisedReplay replay = filled(0, 1);
  for (std::size_t k = 0; k < 8; ++k) EXPECT_EQ(replay.tree().get(k), 1);
  Rng rng(4, 0, Stream::kSample);
  ReplayBatch batch;
  replay.sample(50, rng, batch);
  for (const float weight : batch.weights) EXPECT_EQ(weight, 1);
}

TEST(PrioritisedReplay, NewTransitionsGetTheLargestPrioritySeen) {
  PrioritisedReplay replay(4, 2, 1, 0.5, 0.4);
  add(replay, 0);
  EXPECT_EQ(replay.tree().get(0), 1);
  setAll(replay, {-9});
  add(replay, 1);
  EXPECT_NEAR(replay.tree().get(1), std::sqrt(9 + 1e-6), 1e-12);
  setAll(replay, {0.25f, 0});
  add(replay, 2);
  EXPECT_NEAR(replay.tree().get(0), std::sqrt(0.25 + 1e-6), 1e-12);
  EXPECT_NEAR(replay.tree().get(1), std::sqrt(1e-6), 1e-12) << "never zero";
  EXPECT_NEAR(replay.tree().get(2), std::sqrt(9 + 1e-6), 1e-12) << "seen, if no longer held";
  // overwriting a slot also replaces its priority
  add(replay, 3);
  add(replay, 4);
  EXPECT_NEAR(replay.tree().get(0), std::sqrt(9 + 1e-6), 1e-12);
  EXPECT_EQ(replay.buffer()[0].reward, 8);
}

TEST(PrioritisedReplay, OneSeedOneBatch) {
  const PrioritisedReplay replay = filled(0.6, 0.4);
  Rng rng(5, 0, Stream::kSample), same(5, 0, Stream::kSample), other(6, 0, Stream::kSample);
  ReplayBatch a, b, c;
  replay.sample(64, rng, a);
  replay.sample(64, same, b);
  replay.sample(64, other, c);
  EXPECT_EQ(a.slots, b.slots);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_NE(a.slots, c.slots);
}

}  // namespace
}  // namespace pmeta
