#include "pmeta_core/learn/tabular.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "../support.h"
#include "pmeta_core/env/gridworld.h"

namespace pmeta {
namespace {

QTable randomTable(const TabularEnv& env, unsigned seed, double scale = 10) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-scale, scale);
  QTable q(static_cast<std::size_t>(env.numStates()) * env.numActions());
  for (double& value : q) value = uniform(random);
  return q;
}

TEST(GreedyAction, TakesTheLargestAndTheFirstOfEquals) {
  const double rising[] = {1, 2, 3, 4};
  const double tied[] = {-1, 5, 5, 5};
  const double flat[] = {0, 0, 0, 0};
  EXPECT_EQ(greedyAction(rising, 4), 3);
  EXPECT_EQ(greedyAction(rising, 2), 1);
  EXPECT_EQ(greedyAction(tied, 4), 1);
  EXPECT_EQ(greedyAction(flat, 4), 0);
}

TEST(EvaluateGreedy, MatchesAHandComputation) {
  // 2x2 cells, landmark at (1,1), always up, 8 steps: (0,0) bumps at distance 2, (0,1) at
  // distance 1, (1,0) goes to (0,0) and bumps there
  const Gridworld env({2, 1, 1, 0}, 2);
  const ReturnStats up = evaluateGreedy(env, QTable(16, 0.0));
  EXPECT_EQ(up.episodes, 3);
  EXPECT_DOUBLE_EQ(up.mean, -(16 + 8 + 16) / 3.0);
  EXPECT_DOUBLE_EQ(up.std, std::sqrt((2 * std::pow(8.0 / 3, 2) + std::pow(16.0 / 3, 2)) / 3));

  // down, then right: one step at distance 1 from (0,0), none from the others but up's (0,1)
  QTable q(16, 0.0);
  q[0 * 4 + 1] = q[1 * 4 + 1] = q[2 * 4 + 3] = 1;
  const ReturnStats best = evaluateGreedy(env, q);
  EXPECT_DOUBLE_EQ(best.mean, -1.0 / 3);
}

TEST(EvaluateGreedy, TheLastStepCountsAndNoMore) {
  // always left on a 3x3 grid with the landmark at (2,2): 12 steps, the first ones on the way
  const Gridworld env({3, 2, 2, 0}, 3);
  QTable q(36, 0.0);
  for (int s = 0; s < 9; ++s) q[s * 4 + 2] = 1;
  double sum = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (row == 2 && column == 2) continue;
      for (int step = 1; step <= 12; ++step) sum -= (2 - row) + (2 - std::max(0, column - step));
    }
  }
  EXPECT_DOUBLE_EQ(evaluateGreedy(env, q).mean, sum / 8);
}

TEST(EvaluateGreedy, AgreesWithRolloutsUnderSlip) {
  for (const GridworldTask task : {GridworldTask{4, 3, 3, 0.3}, GridworldTask{3, 1, 0, 0.6}}) {
    Gridworld env(task, 5);
    const QTable q = randomTable(env, 21);
    Rng rng(1, 0, Stream::kMeasure);
    const int episodes = 40000;
    double sum = 0, squares = 0;
    double seen[2];
    for (int i = 0; i < episodes; ++i) {
      env.reset(rng, seen);
      double total = 0;
      for (Step step; !step.terminated && !step.truncated;) {
        const double* values = &q[static_cast<std::size_t>(env.stateOf(seen)) * 4];
        double action = 0;
        for (int a = 1; a < 4; ++a) {
          if (values[a] > values[static_cast<int>(action)]) action = a;
        }
        step = env.step(&action, rng, seen);
        total += step.reward;
      }
      sum += total;
      squares += total * total;
    }
    const double mean = sum / episodes;
    const double error = std::sqrt((squares / episodes - mean * mean) / episodes);
    EXPECT_NEAR(evaluateGreedy(env, q).mean, mean, 4 * error);
    EXPECT_LT(error, 0.2) << "the rollouts must be able to tell";
  }
}

double meanOptimum(const std::vector<std::string>& assignments) {
  GridworldFamily family;
  Settings settings;
  family.bind(settings);
  for (const std::string& one : assignments) settings.assign(one);
  family.build(0);
  double sum = 0;
  for (int i = 0; i < family.numTasks(); ++i) {
    sum += optimalReturn(dynamic_cast<TabularEnv&>(*family.make(i))).mean;
  }
  return sum / family.numTasks();
}

TEST(OptimalReturn, IsTheClosedFormOnEveryGrid) {
  for (const GridworldTask task :
       {GridworldTask{4, 3, 3, 0}, GridworldTask{5, 2, 2, 0}, GridworldTask{8, 0, 3, 0}}) {
    const Gridworld env(task, 8);
    double sum = 0, squares = 0;
    for (int row = 0; row < task.size; ++row) {
      for (int column = 0; column < task.size; ++column) {
        const int d = std::abs(row - task.landmark_row) + std::abs(column - task.landmark_column);
        const double best = -d * (d - 1) / 2.0;
        sum += best;
        squares += best * best;
      }
    }
    const int n = task.size * task.size - 1;
    const ReturnStats stats = optimalReturn(env);
    EXPECT_EQ(stats.episodes, n);
    EXPECT_NEAR(stats.mean, sum / n, 1e-12);
    EXPECT_NEAR(stats.std, std::sqrt(squares / n - sum / n * sum / n), 1e-9);
  }
}

TEST(OptimalReturn, HasTheKnownMeansOfThePapersTasks) {
  EXPECT_NEAR(meanOptimum({"landmark:=corner"}), -14.442976190476191, 1e-12);
  EXPECT_NEAR(meanOptimum({"landmark:=centre"}), -4.182857142857142, 1e-12);
}

TEST(OptimalReturn, IsAboveEveryPolicyAndReachedByAGreedyOne) {
  const Gridworld slippery({4, 3, 3, 0.3}, 4);
  const double ceiling = optimalReturn(slippery).mean;
  for (unsigned seed = 0; seed < 50; ++seed) {
    EXPECT_LE(evaluateGreedy(slippery, randomTable(slippery, seed)).mean, ceiling + 1e-12);
  }
  // value iteration with hardly any discount gives the best policy
  QTable q(64, 0.0);
  for (int sweep = 0; sweep < 2000; ++sweep) {
    for (const int s : slippery.ownedStates()) {
      for (int a = 0; a < 4; ++a) q[s * 4 + a] = bellmanBackup(slippery, q, s, a, 0.9999);
    }
  }
  EXPECT_NEAR(evaluateGreedy(slippery, q).mean, ceiling, 1e-6);
}

TEST(BellmanBackup, MatchesTheDefinitionOnRandomTables) {
  for (const double slip : {0.0, 0.5}) {
    const GridworldTask task{4, 1, 2, slip};
    const Gridworld env(task, 6);
    const QTable q = randomTable(env, 5);
    for (const int s : env.ownedStates()) {
      for (int a = 0; a < 4; ++a) {
        double expected = 0;
        for (int move = 0; move < 4; ++move) {
          const double p = (move == a ? 1 - slip : 0) + slip / 4;
          const int row = std::clamp(s / 6 + (move == 1) - (move == 0), 0, 3);
          const int column = std::clamp(s % 6 + (move == 3) - (move == 2), 0, 3);
          const int d = std::abs(row - 1) + std::abs(column - 2);
          double best = -1e300;
          for (int b = 0; b < 4; ++b) best = std::max(best, q[(row * 6 + column) * 4 + b]);
          expected += p * (-d + (d == 0 ? 0 : 0.9 * best));
        }
        EXPECT_NEAR(bellmanBackup(env, q, s, a, 0.9), expected, 1e-12);
      }
    }
  }
}

// (lambda omega + r + gamma E max Q) / (1 + lambda) over the owned entries
QTable regularised(const TabularEnv& env, const QTable& q, const QTable& omega, double lambda) {
  QTable out(q.size(), 0.0);
  for (const int s : env.ownedStates()) {
    for (int a = 0; a < 4; ++a) {
      const std::size_t k = static_cast<std::size_t>(s) * 4 + a;
      out[k] = (lambda * omega[k] + bellmanBackup(env, q, s, a, 0.9)) / (1 + lambda);
    }
  }
  return out;
}

double maxGap(const TabularEnv& env, const QTable& a, const QTable& b) {
  double gap = 0;
  for (const int s : env.ownedStates()) {
    for (int k = 4 * s; k < 4 * s + 4; ++k) gap = std::max(gap, std::abs(a[k] - b[k]));
  }
  return gap;
}

TEST(RegularisedOperator, ContractsByGammaOverOnePlusLambda) {
  const Gridworld env({5, 2, 3, 0.2}, 5);
  const QTable omega = randomTable(env, 99);
  for (const double lambda : {0.0, 1.0, 5.0, 10.0, 50.0}) {
    const double factor = 0.9 / (1 + lambda);
    for (unsigned pair = 0; pair < 100; ++pair) {
      const QTable a = randomTable(env, 2 * pair), b = randomTable(env, 2 * pair + 1);
      EXPECT_LE(maxGap(env, regularised(env, a, omega, lambda), regularised(env, b, omega, lambda)),
                factor * maxGap(env, a, b) * (1 + 1e-12));
    }
    // a constant shift attains the bound: it is not a slack one
    const QTable a = randomTable(env, 7);
    QTable shifted = a;
    for (double& value : shifted) value += 3;
    EXPECT_NEAR(
        maxGap(env, regularised(env, a, omega, lambda), regularised(env, shifted, omega, lambda)),
        factor * 3, 1e-12);
  }
}

}  // namespace
}  // namespace pmeta
