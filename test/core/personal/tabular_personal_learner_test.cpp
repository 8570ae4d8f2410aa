#include "pmeta_core/learn/tabular_learner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "../support.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta {
namespace {

constexpr int kStride = 5;

PersonalLearner makeLearner(const PersonalSettings& personal,
                            const QLearningSettings& q_learning = {},
                            const GridworldTask& task = {4, 2, 3, 0}) {
  PersonalParts parts;
  parts.learner =
      std::make_unique<TabularLearner>(std::make_unique<Gridworld>(task, kStride), q_learning);
  parts.evaluation_envs.push_back(std::make_unique<Gridworld>(task, kStride));
  return PersonalLearner(std::move(parts), personal);
}

Model numbered(const ModelLayout& layout) {
  Model model(layout);
  for (std::size_t k = 0; k < model.size(); ++k) model.doubles()[k] = -std::fmod(3.7 * k, 13);
  return model;
}

TEST(TabularPersonalLearner, LayoutIsTheSharedTable) {
  EXPECT_EQ(makeLearner({}).layout().text(), "float64\nq_table 25 4\n");
}

TEST(TabularPersonalLearner, MarksExactlyItsOwnStatesAsPresent) {
  const auto learner = makeLearner({});
  for (const Model* model : {&learner.personal(), &learner.auxiliary()}) {
    ASSERT_EQ(model->present.size(), 100u);
    for (int row = 0; row < kStride; ++row) {
      for (int column = 0; column < kStride; ++column) {
        const bool owned = row < 4 && column < 4 && !(row == 2 && column == 3);
        for (int a = 0; a < 4; ++a) {
          EXPECT_EQ(model->present[(row * kStride + column) * 4 + a], owned ? 1 : 0);
        }
      }
    }
  }
}

TEST(TabularPersonalLearner, BeginsAtTheInitialValueWhateverTheSeed) {
  QLearningSettings q_learning;
  q_learning.initial_value = -2.5;
  const auto learner = makeLearner({}, q_learning);
  EXPECT_EQ(learner.initialModel(0).doubles(), std::vector<double>(100, -2.5));
  EXPECT_TRUE(learner.initialModel(0) == learner.initialModel(77));
  EXPECT_TRUE(learner.initialModel(0).present.empty());
}

TEST(TabularPersonalLearner, RoundBeginsFromTheMetaPolicy) {
  auto learner = makeLearner({});
  const Model meta = numbered(learner.layout());
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(Model(learner.layout()), false);
  learner.update(rng);
  learner.beginRound(meta, false);
  EXPECT_EQ(learner.personal().doubles(), meta.doubles());
  EXPECT_EQ(learner.auxiliary().doubles(), meta.doubles());
}

TEST(TabularPersonalLearner, KeptParametersSurviveTheRoundsStart) {
  auto learner = makeLearner({});
  const Model meta = numbered(learner.layout());
  Rng rng(1, 0, Stream::kSample);
  learner.beginRound(meta, true);
  EXPECT_EQ(learner.personal().doubles(), meta.doubles()) << "nothing to keep in the first round";
  learner.update(rng);
  const std::vector<double> kept = learner.personal().doubles();
  learner.beginRound(Model(learner.layout()), true);
  EXPECT_EQ(learner.personal().doubles(), kept);
  EXPECT_EQ(learner.auxiliary().doubles(), std::vector<double>(100, 0.0));
}

// K batches and an auxiliary step on maps of cells, written from the equations
struct Reference {
  using Key = std::tuple<int, int, int>;  // row, column, action
  GridworldTask task;
  double alpha, lambda, eta, gamma;
  std::map<Key, double> phi, omega;

  double best(int row, int column) {
    double value = phi[{row, column, 0}];
    for (int a = 1; a < 4; ++a) value = std::max(value, phi[{row, column, a}]);
    return value;
  }

  void batch(int samples, Rng& rng) {
    std::vector<std::pair<int, int>> cells;
    for (int r = 0; r < task.size; ++r) {
      for (int c = 0; c < task.size; ++c) {
        if (r != task.landmark_row || c != task.landmark_column) cells.push_back({r, c});
      }
    }
    for (int i = 0; i < samples; ++i) {
      const auto [row, column] = cells[rng.below(cells.size())];
      const int a = static_cast<int>(rng.below(4));
      int r = row, c = column;
      (a < 2 ? r : c) += a % 2 == 0 ? -1 : 1;
      if (r < 0 || c < 0 || r == task.size || c == task.size) r = row, c = column;
      const int d = std::abs(r - task.landmark_row) + std::abs(c - task.landmark_column);
      const double target = d == 0 ? 0 : -d + gamma * best(r, c);
      double& q = phi[{row, column, a}];
      q = (1 - alpha * (1 + lambda)) * q + alpha * (target + lambda * omega[{row, column, a}]);
    }
  }

  void moveAuxiliary() {
    for (auto& [key, value] : omega) {
      value = (1 - eta * lambda) * value + eta * lambda * phi[key];
    }
  }
};

TEST(TabularPersonalLearner, UpdatesFollowTheEquations) {
  for (const int batches : {1, 3}) {
    PersonalSettings personal;
    personal.alpha = 0.06;
    personal.lambda = 7;
    personal.eta = 0.11;
    QLearningSettings q_learning;
    q_learning.updates = batches;
    q_learning.samples_per_entry = 1.5;
    const GridworldTask task{4, 2, 3, 0};
    auto learner = makeLearner(personal, q_learning, task);
    const Model meta = numbered(learner.layout());

    Reference reference{task, 0.06, 7, 0.11, 0.9, {}, {}};
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) {
        for (int a = 0; a < 4; ++a) {
          reference.phi[{r, c, a}] = reference.omega[{r, c, a}] =
              meta.doubles()[(r * kStride + c) * 4 + a];
        }
      }
    }

    learner.beginRound(meta, false);
    Rng rng(3, 0, Stream::kSample), reference_rng(3, 0, Stream::kSample);
    for (int r = 0; r < 20; ++r) {
      const UpdateStats stats = learner.update(rng);
      EXPECT_EQ(stats.updates, batches);
      EXPECT_EQ(stats.env_steps, batches * 90);
      EXPECT_GT(stats.loss, 0);
      for (int k = 0; k < batches; ++k) reference.batch(90, reference_rng);
      reference.moveAuxiliary();
    }
    for (const auto& [key, value] : reference.phi) {
      const auto [r, c, a] = key;
      const std::size_t k = (r * kStride + c) * 4 + a;
      EXPECT_NEAR(learner.personal().doubles()[k], value, 1e-11);
      EXPECT_NEAR(learner.auxiliary().doubles()[k], reference.omega[key], 1e-11);
    }
    // what the task does not own stays the meta-policy's
    for (std::size_t k = 0; k < 100; ++k) {
      if (learner.personal().isPresent(k)) continue;
      EXPECT_EQ(learner.personal().doubles()[k], meta.doubles()[k]);
      EXPECT_EQ(learner.auxiliary().doubles()[k], meta.doubles()[k]);
    }
  }
}

TEST(TabularPersonalLearner, AuxiliaryEqualsPersonalAfterEachUpdateWhereEtaLambdaIsOne) {
  PersonalSettings personal;
  personal.lambda = 10;
  personal.eta = 0.1;
  auto learner = makeLearner(personal);
  learner.beginRound(numbered(learner.layout()), false);
  Rng rng(5, 0, Stream::kSample);
  for (int r = 0; r < 10; ++r) {
    learner.update(rng);
    EXPECT_LT(distance(learner.personal(), learner.auxiliary()), 1e-12);
  }
}

TEST(TabularPersonalLearner, EvaluationIsTheExactGreedyReturn) {
  const auto learner = makeLearner({});
  const Model policy = numbered(learner.layout());
  Rng rng(1, 0, Stream::kEvaluate);
  const auto state = rng.state();
  const ReturnStats stats = learner.evaluate(policy, rng);
  const ReturnStats expected = evaluateGreedy(Gridworld({4, 2, 3, 0}, kStride), policy.doubles());
  EXPECT_EQ(stats.mean, expected.mean);
  EXPECT_EQ(stats.std, expected.std);
  EXPECT_EQ(stats.episodes, 15);
  EXPECT_EQ(rng.state(), state) << "exact: nothing is drawn";
}

TEST(TabularPersonalLearner, RecordedEpisodesObeyTheGridAndThePolicy) {
  const GridworldTask task{4, 2, 3, 0};
  const auto learner = makeLearner({}, {}, task);
  const Model policy = numbered(learner.layout());
  const QTable& q = policy.doubles();
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed, 0, Stream::kEvaluate);
    const Episode e = learner.record(policy, rng);
    const std::size_t steps = e.rewards.size();
    ASSERT_EQ(e.observation_size, 2);
    ASSERT_EQ(e.action_size, 1);
    ASSERT_EQ(e.observations.size(), 2 * (steps + 1));
    ASSERT_EQ(e.actions.size(), steps);
    EXPECT_NE(e.terminated, e.truncated);
    EXPECT_EQ(e.truncated, steps == 16 && e.rewards.back() != 0);
    for (std::size_t t = 0; t < steps; ++t) {
      const int row = static_cast<int>(e.observations[2 * t]);
      const int column = static_cast<int>(e.observations[2 * t + 1]);
      const int action = static_cast<int>(e.actions[t]);
      for (int a = 0; a < 4; ++a) {
        EXPECT_LE(q[(row * kStride + column) * 4 + a], q[(row * kStride + column) * 4 + action]);
      }
      const double moved =
          std::abs(e.observations[2 * t + 2] - row) + std::abs(e.observations[2 * t + 3] - column);
      EXPECT_LE(moved, 1);
      EXPECT_EQ(e.rewards[t], -std::abs(e.observations[2 * t + 2] - task.landmark_row) -
                                  std::abs(e.observations[2 * t + 3] - task.landmark_column));
    }
  }
}

TEST(TabularPersonalLearner, RecordedValuesAreTheTables) {
  const auto learner = makeLearner({});
  const Model policy = numbered(learner.layout());
  Rng rng(0, 0, Stream::kEvaluate);
  const Episode e = learner.record(policy, rng);
  ASSERT_EQ(e.state_values.size(), 25u);
  ASSERT_EQ(e.greedy_actions.size(), 25u);
  for (int s = 0; s < 25; ++s) {
    if (learner.personal().isPresent(4 * s)) {
      EXPECT_EQ(e.state_values[s], policy.doubles()[4 * s + e.greedy_actions[s]]);
    } else {
      EXPECT_TRUE(std::isnan(e.state_values[s]));
      EXPECT_EQ(e.greedy_actions[s], -1);
    }
  }
}

}  // namespace
}  // namespace pmeta
