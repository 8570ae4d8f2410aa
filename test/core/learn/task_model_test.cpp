#include "pmeta_core/learn/task_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "../support.h"
#include "pmeta_core/learn/task_model_update.h"
#include "sac_trainer.h"

namespace pmeta {
namespace {

using test::Descent;

constexpr std::size_t kTasks = 3;
const std::vector<float> kSecond = {0, 1, 0};

TaskModelSettings smallModel(bool dynamics) {
  TaskModelSettings settings;
  settings.hidden = {6, 5};
  settings.dynamics = dynamics;
  return settings;
}

// transitions with the reward a[0] - s[0]
ReplayBuffer someTransitions(std::size_t count) {
  ReplayBuffer kept(count, 2, 1);
  Rng rng(4, 0, Stream::kCollect);
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<float> s(2), next(2), a(1);
    for (float* x : {&s[0], &s[1], &next[0], &next[1], &a[0]}) {
      *x = static_cast<float>(rng.normal());
    }
    kept.add({s.data(), a.data(), a[0] - s[0], 0.9f, next.data()});
  }
  return kept;
}

struct Fitted {
  explicit Fitted(bool dynamics, float rate, std::size_t batch = 8)
      : model(2, 1, kTasks, smallModel(dynamics), true),
        parameters(model.size()),
        optimizer(parameters, rate),
        update(model, batch, kSecond) {
    Rng rng(1, 0, Stream::kInitialise);
    model.initialise(parameters.data(), rng);
  }
  TaskModel model;
  AlignedFloats parameters;
  Descent optimizer;
  TaskModelUpdate update;
};

void expectNear(const std::vector<float>& numbers, const std::vector<float>& expected) {
  ASSERT_EQ(numbers.size(), expected.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) EXPECT_NEAR(numbers[i], expected[i], 1e-6) << i;
}

TEST(TaskModel, RowsHoldWhatIsKnownBeforeAndOutcomesWhatComesOfIt) {
  const float s[] = {3, -1}, a[] = {0.5f}, next[] = {3.1f, -1};
  const Transition transition{s, a, -7, 0, next};
  const auto symlog = [](float x) { return std::copysign(std::log1p(std::abs(x)), x); };
  const float change = symlog(20 * (next[0] - s[0]));
  std::vector<float> row(5), outcome(1);
  const TaskModel reward(2, 1, kTasks, smallModel(false), false);
  ASSERT_EQ(reward.rowSize(), 5u);
  ASSERT_EQ(reward.outputs(), 1u);
  reward.write(transition, row.data(), outcome.data());
  expectNear(row, {symlog(3), symlog(-1), 0.5f, change, 0});
  expectNear(outcome, {-7});

  const TaskModel dynamics(2, 1, kTasks, smallModel(true), false);
  ASSERT_EQ(dynamics.rowSize(), 3u);
  ASSERT_EQ(dynamics.outputs(), 3u);
  row.resize(3);
  outcome.resize(3);
  dynamics.write(transition, row.data(), outcome.data());
  expectNear(row, {symlog(3), symlog(-1), 0.5f});
  expectNear(outcome, {-7, change, 0});
}

TEST(TaskModel, BeginsWithUnitVariancesAndNamesItsBlocks) {
  const Fitted fitted(true, 0);
  std::size_t size = 0;
  for (const Block& block : fitted.model.blocks()) size += block.size();
  EXPECT_EQ(size, fitted.model.size());
  EXPECT_EQ(fitted.model.blocks().front().name, "task_model.layer0.weight");
  EXPECT_EQ(fitted.model.blocks().back().name, "task_model.log_variance");
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(fitted.parameters[fitted.model.size() - 1 - k], 0);
}

class Gradients : public ::testing::TestWithParam<bool> {};

// of the sum over outputs of L_k by the network, and of (L_k / e^v + v) / 2 by v, in double
TEST_P(Gradients, AreThoseOfTheLossesByCentralDifferences) {
  Fitted fitted(GetParam(), 0);
  const TaskModel& model = fitted.model;
  const Mlp& network = model.network();
  for (std::size_t k = 0; k < model.outputs(); ++k) {
    fitted.parameters[network.size() + k] = 0.3f * static_cast<float>(k) - 0.4f;
  }
  const ReplayBuffer kept = someTransitions(20);
  Rng rng(2, 0, Stream::kTaskModel), same = rng;
  const double loss = fitted.update.apply(fitted.parameters.data(), kept, 0, fitted.optimizer, rng);

  std::vector<test::Vector> rows, outcomes;
  for (int b = 0; b < 8; ++b) {
    std::vector<float> row(model.rowSize()), outcome(model.outputs());
    model.write(kept[same.below(kept.size())], row.data(), outcome.data());
    rows.emplace_back(row.begin(), row.end());
    rows.back().insert(rows.back().end(), kSecond.begin(), kSecond.end());
    outcomes.emplace_back(outcome.begin(), outcome.end());
  }
  const auto squares = [&](const test::Vector& p) {
    test::Vector l(model.outputs());
    for (std::size_t b = 0; b < rows.size(); ++b) {
      const test::Vector f = test::outputs(network, p.data(), rows[b]);
      for (std::size_t k = 0; k < l.size(); ++k) l[k] += std::pow(f[k] - outcomes[b][k], 2) / 8;
    }
    return l;
  };
  const auto sum = [&](const test::Vector& p) {
    double all = 0;
    for (const double l : squares(p)) all += l;
    return all;
  };
  const test::Vector p(fitted.parameters.begin(), fitted.parameters.end());
  EXPECT_NEAR(loss, sum(p), 1e-5);
  const double h = 1e-5;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const auto objective = [&](double shift) {
      test::Vector moved = p;
      moved[i] += shift;
      if (i < network.size()) return sum(moved);
      return (squares(p)[i - network.size()] / std::exp(moved[i]) + moved[i]) / 2;
    };
    EXPECT_NEAR(fitted.optimizer.gradient[i], (objective(h) - objective(-h)) / (2 * h), 2e-4) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(TaskModel, Gradients, ::testing::Values(false, true),
                         [](const auto& info) { return info.param ? "Dynamics" : "Reward"; });

TEST(TaskModel, LearnsTheRewardAndTheVarianceOfItsErrors) {
  Fitted fitted(false, 0.02f, 64);
  const ReplayBuffer kept = someTransitions(400);
  Rng rng(2, 0, Stream::kTaskModel);
  double recent = 0;
  for (int i = 0; i < 4000; ++i) {
    const double loss =
        fitted.update.apply(fitted.parameters.data(), kept, 0, fitted.optimizer, rng);
    recent += 0.02 * (loss - recent);
    if (i == 0) {
      EXPECT_GT(loss, 1);
    }
  }
  EXPECT_LT(recent, 0.1);
  EXPECT_NEAR(fitted.parameters[fitted.model.size() - 1], std::log(recent), 0.4);
}

// weights of the input of other tasks get no gradient
TEST(TaskModel, MovesNoOtherTasksColumn) {
  Fitted fitted(false, 0.1f);
  const AlignedFloats before = fitted.parameters;
  Rng rng(2, 0, Stream::kTaskModel);
  fitted.update.apply(fitted.parameters.data(), someTransitions(20), 0, fitted.optimizer, rng);
  bool own_moved = false;
  const std::size_t inputs = fitted.model.network().inputs();
  for (std::size_t o = 0; o < 6; ++o) {
    const std::size_t column = o * inputs + fitted.model.rowSize();
    EXPECT_EQ(fitted.parameters[column], before[column]);
    EXPECT_EQ(fitted.parameters[column + 2], before[column + 2]);
    own_moved = own_moved || fitted.parameters[column + 1] != before[column + 1];
  }
  EXPECT_TRUE(own_moved);
}

}  // namespace
}  // namespace pmeta
