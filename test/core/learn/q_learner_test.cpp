#include "pmeta_core/learn/q_learner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "../support.h"
#include "pmeta_core/env/gridworld.h"

namespace pmeta {
namespace {

// keeps what it is handed; moves the table by `rate` if given one
class Recorder : public Optimizer<double> {
 public:
  explicit Recorder(QTable* q = nullptr, double rate = 0) : q_(q), rate_(rate) {}
  void move(std::size_t offset, const double* gradient, std::size_t n, double*, double) override {
    EXPECT_EQ(n, 1u);
    entries.push_back(offset);
    gradients.push_back(*gradient);
    if (q_ != nullptr) (*q_)[offset] -= rate_ * *gradient;
  }
  std::vector<std::size_t> entries;
  std::vector<double> gradients;

 private:
  QTable* q_;
  double rate_;
};

// target of a certain move: -distance + gamma max Q(s',.), nothing after the landmark
double targetOf(const Gridworld& env, int stride, const QTable& q, std::size_t entry) {
  const GridworldTask& task = env.task();
  const int row = static_cast<int>(entry / 4) / stride,
            column = static_cast<int>(entry / 4) % stride;
  const int action = static_cast<int>(entry % 4);
  const int r = std::min(std::max(row + (action == 1) - (action == 0), 0), task.size - 1);
  const int c = std::min(std::max(column + (action == 3) - (action == 2), 0), task.size - 1);
  const int d = std::abs(r - task.landmark_row) + std::abs(c - task.landmark_column);
  if (d == 0) return 0;
  const auto next = q.begin() + (r * stride + c) * 4;
  return -d + 0.9 * *std::max_element(next, next + 4);
}

QTable numbered(std::size_t n) {
  QTable q(n);
  for (std::size_t k = 0; k < n; ++k) q[k] = std::sin(static_cast<double>(k)) * 7;
  return q;
}

TEST(QLearner, GradientIsTheTdErrorOfEachEntry) {
  const Gridworld env({4, 2, 3, 0}, 6);
  const QLearner learner(env, 0.9);
  const QTable q = numbered(6 * 6 * 4);
  Recorder recorder;
  Rng rng(1, 0, Stream::kSample);
  const auto stats = learner.learnBatch(q, 3, recorder, rng);
  ASSERT_EQ(recorder.entries.size(), 3u * 15 * 4);
  EXPECT_EQ(stats.samples, 180);
  double sum = 0;
  for (std::size_t i = 0; i < recorder.entries.size(); ++i) {
    const std::size_t entry = recorder.entries[i];
    EXPECT_NEAR(recorder.gradients[i], q[entry] - targetOf(env, 6, q, entry), 1e-12);
    sum += std::abs(q[entry] - targetOf(env, 6, q, entry));
  }
  EXPECT_NEAR(stats.mean_abs_td_error, sum / 180, 1e-12);
}

TEST(QLearner, DoesNotBootstrapFromTheLandmark) {
  const Gridworld env({2, 1, 1, 0}, 2);
  QTable q(16, 0.0);
  for (int k = 12; k < 16; ++k) q[k] = 1e6;
  Recorder recorder;
  Rng rng(2, 0, Stream::kSample);
  QLearner(env, 0.9).learnBatch(q, 10, recorder, rng);
  for (const double gradient : recorder.gradients) EXPECT_LT(std::abs(gradient), 10);
}

TEST(QLearner, EachSampleSeesTheStepsBeforeIt) {
  const Gridworld env({3, 2, 2, 0}, 3);
  QTable q = numbered(36), replay = q;
  Recorder recorder(&q, 0.5);
  Rng rng(3, 0, Stream::kSample);
  QLearner(env, 0.9).learnBatch(q, 4, recorder, rng);
  for (std::size_t i = 0; i < recorder.entries.size(); ++i) {
    const std::size_t entry = recorder.entries[i];
    const double gradient = replay[entry] - targetOf(env, 3, replay, entry);
    ASSERT_NEAR(recorder.gradients[i], gradient, 1e-12) << "sample " << i;
    replay[entry] -= 0.5 * gradient;
  }
}

TEST(QLearner, DrawsOwnedEntriesUniformly) {
  const Gridworld env({3, 1, 1, 0}, 5);
  Recorder recorder;
  Rng rng(4, 0, Stream::kSample);
  QLearner(env, 0.9).learnBatch(QTable(100, 0.0), 500, recorder, rng);
  std::map<std::size_t, int> counts;
  for (const std::size_t entry : recorder.entries) ++counts[entry];
  std::vector<int> owned;
  for (const int s : env.ownedStates()) {
    for (int a = 0; a < 4; ++a) owned.push_back(counts[static_cast<std::size_t>(s) * 4 + a]);
  }
  EXPECT_EQ(counts.size(), owned.size()) << "nothing but owned entries";
  EXPECT_LT(test::chiSquare(owned), 69.9);  // 99.99 %, 31 degrees of freedom
}

TEST(QLearner, RoundsTheNumberOfSamplesToAtLeastOne) {
  const Gridworld env({2, 1, 1, 0}, 2);  // 12 entries
  const std::vector<std::pair<double, int>> cases = {{1, 12},       {2, 24},   {0.5, 6},
                                                     {1.0 / 12, 1}, {0.13, 2}, {0.04, 1}};
  for (const auto& [samples_per_entry, samples] : cases) {
    Recorder recorder;
    Rng rng(5, 0, Stream::kSample);
    const auto stats =
        QLearner(env, 0.9).learnBatch(QTable(16, 0.0), samples_per_entry, recorder, rng);
    EXPECT_EQ(stats.samples, samples) << samples_per_entry;
    EXPECT_EQ(recorder.entries.size(), static_cast<std::size_t>(samples));
    EXPECT_FALSE(std::isnan(stats.mean_abs_td_error));
  }
}

TEST(QLearner, AverageGradientUnderSlipIsTheBackups) {
  const Gridworld env({3, 2, 2, 0.5}, 3);
  const QTable q = numbered(36);
  Recorder recorder;
  Rng rng(6, 0, Stream::kSample);
  QLearner(env, 0.9).learnBatch(q, 4000, recorder, rng);
  std::vector<double> sum(36), squares(36), n(36);
  for (std::size_t i = 0; i < recorder.entries.size(); ++i) {
    sum[recorder.entries[i]] += recorder.gradients[i];
    squares[recorder.entries[i]] += recorder.gradients[i] * recorder.gradients[i];
    ++n[recorder.entries[i]];
  }
  for (const int s : env.ownedStates()) {
    for (int a = 0; a < 4; ++a) {
      const int k = 4 * s + a;
      const double mean = sum[k] / n[k];
      const double error = std::sqrt((squares[k] / n[k] - mean * mean) / n[k]);
      EXPECT_NEAR(mean, q[k] - bellmanBackup(env, q, s, a, 0.9), 4.5 * error + 1e-9);
    }
  }
}

}  // namespace
}  // namespace pmeta
