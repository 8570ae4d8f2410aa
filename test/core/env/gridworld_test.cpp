#include "pmeta_core/env/gridworld.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "../support.h"

namespace pmeta {
namespace {

using test::chiSquare;
using test::errorOf;

using Cell = std::pair<int, int>;  // row, column

constexpr int kUp = 0, kDown = 1, kLeft = 2, kRight = 3;

// the rules in words: one cell that way unless a wall is there
Cell moveFrom(Cell cell, int action, int size) {
  if (action == kUp && cell.first > 0) --cell.first;
  if (action == kDown && cell.first + 1 < size) ++cell.first;
  if (action == kLeft && cell.second > 0) --cell.second;
  if (action == kRight && cell.second + 1 < size) ++cell.second;
  return cell;
}

std::vector<GridworldTask> manyTasks() {
  std::vector<GridworldTask> tasks;
  for (const int size : {2, 3, 5}) {
    for (const Cell& landmark : {Cell{size - 1, size - 1}, Cell{0, 0}, Cell{size / 2, size - 1},
                                 Cell{size / 2, size / 2}}) {
      for (const double slip : {0.0, 0.3, 0.999}) {
        tasks.push_back({size, landmark.first, landmark.second, slip});
      }
    }
  }
  return tasks;
}

TEST(Gridworld, OutcomesFollowTheRulesInEveryState) {
  for (const GridworldTask& task : manyTasks()) {
    const int stride = task.size + 2;
    const Gridworld env(task, stride);
    for (const int state : env.ownedStates()) {
      const Cell cell{state / stride, state % stride};
      for (int action = 0; action < 4; ++action) {
        std::map<Cell, double> expected;
        expected[moveFrom(cell, action, task.size)] += 1 - task.slip;
        for (int any = 0; any < 4; ++any) {
          expected[moveFrom(cell, any, task.size)] += task.slip / 4;
        }

        std::map<Cell, double> found;
        double total = 0;
        for (const Outcome& outcome : env.outcomes(state, action)) {
          const Cell next{outcome.next_state / stride, outcome.next_state % stride};
          const int away = std::abs(next.first - task.landmark_row) +
                           std::abs(next.second - task.landmark_column);
          EXPECT_EQ(outcome.reward, -away);
          EXPECT_EQ(outcome.terminated, away == 0);
          EXPECT_GT(outcome.probability, 0);
          found[next] += outcome.probability;
          total += outcome.probability;
        }
        EXPECT_NEAR(total, 1, 1e-15);
        for (const auto& [next, probability] : expected) {
          EXPECT_NEAR(found[next], probability, 1e-15);
        }
        for (const auto& [next, probability] : found) {
          EXPECT_TRUE(expected.count(next) == 1) << next.first << " " << next.second;
        }
      }
    }
  }
}

TEST(Gridworld, OwnsEveryCellButTheLandmark) {
  const Gridworld env({3, 1, 2, 0}, 5);
  EXPECT_EQ(env.ownedStates(), (std::vector<int>{0, 1, 2, 5, 6, 10, 11, 12}));
  EXPECT_EQ(env.numStates(), 25);
  EXPECT_EQ(env.numActions(), 4);
  EXPECT_EQ(env.spec().horizon, 12);
  EXPECT_EQ(env.spec().observation_size, 2);
  EXPECT_EQ(env.spec().action_size, 1);
}

TEST(Gridworld, SteppingFollowsTheRules) {
  for (const GridworldTask& task : manyTasks()) {
    if (task.slip != 0) continue;
    Gridworld env(task, 9);
    Rng rng(4, 0, Stream::kMeasure), choices(5, 0, Stream::kMeasure);
    double seen[2];
    for (int episode = 0; episode < 30; ++episode) {
      env.reset(rng, seen);
      for (int steps = 1;; ++steps) {
        const double action = static_cast<double>(choices.below(4));
        const Cell expected = moveFrom({static_cast<int>(seen[0]), static_cast<int>(seen[1])},
                                       static_cast<int>(action), task.size);
        const Step step = env.step(&action, rng, seen);
        ASSERT_EQ(seen[0], expected.first);
        ASSERT_EQ(seen[1], expected.second);
        ASSERT_EQ(env.stateOf(seen), expected.first * 9 + expected.second);
        const bool there = expected == Cell{task.landmark_row, task.landmark_column};
        ASSERT_EQ(step.reward, -std::abs(expected.first - task.landmark_row) -
                                   std::abs(expected.second - task.landmark_column));
        ASSERT_EQ(step.terminated, there);
        ASSERT_EQ(step.truncated, !there && steps == 4 * task.size);
        if (step.terminated || step.truncated) break;
      }
    }
  }
}

TEST(Gridworld, TruncatesAfterExactlyFourTimesTheSize) {
  for (const int size : {2, 4, 7}) {
    Gridworld env({size, size - 1, size - 1, 0}, size);
    Rng rng(6, 0, Stream::kMeasure);
    double seen[2];
    const double up = kUp;
    for (int episode = 0; episode < 3; ++episode) {
      env.reset(rng, seen);
      int steps = 0;
      Step step;
      do {
        step = env.step(&up, rng, seen);
        ++steps;
        ASSERT_FALSE(step.terminated);
      } while (!step.truncated && steps < 1000);
      EXPECT_EQ(steps, 4 * size);
    }
  }
}

TEST(Gridworld, TheLandmarkOnTheLastStepTerminatesAndDoesNotTruncate) {
  const int size = 4;
  Gridworld env({size, size - 1, size - 1, 0}, size);
  Rng rng(7, 0, Stream::kMeasure);
  double seen[2];
  env.reset(rng, seen);
  const int column = static_cast<int>(seen[1]);
  const int way = (size - 1) + (size - 1 - column);
  Step step;
  for (int i = 1; i <= 4 * size; ++i) {
    ASSERT_FALSE(step.terminated || step.truncated);
    // wait at the upper wall, then down and right
    const int left = 4 * size - i;
    const double action = left >= way ? kUp : left >= size - 1 - column ? kDown : kRight;
    step = env.step(&action, rng, seen);
  }
  EXPECT_TRUE(step.terminated);
  EXPECT_FALSE(step.truncated);
  EXPECT_EQ(step.reward, 0);
}

TEST(Gridworld, ResetIsUniformOverOwnedCells) {
  Gridworld env({3, 1, 1, 0}, 4);
  Rng rng(8, 0, Stream::kMeasure);
  std::map<int, int> counts;
  double seen[2];
  for (int i = 0; i < 8000; ++i) {
    env.reset(rng, seen);
    ++counts[env.stateOf(seen)];
  }
  EXPECT_EQ(counts.count(1 * 4 + 1), 0u);
  std::vector<int> values;
  for (const int state : env.ownedStates()) values.push_back(counts[state]);
  EXPECT_EQ(counts.size(), values.size());
  EXPECT_LT(chiSquare(values), 29.9);  // 99.99 %, 7 degrees of freedom
}

TEST(Gridworld, SlipsAsOftenAsItSays) {
  const Gridworld env({5, 4, 4, 0.4}, 5);
  Rng rng(9, 0, Stream::kMeasure);
  const int state = 2 * 5 + 2, n = 40000;
  std::map<int, int> counts;
  for (int i = 0; i < n; ++i) ++counts[env.sample(state, kRight, rng).next_state];
  const std::map<int, double> expected = {{7, 0.1}, {17, 0.1}, {11, 0.1}, {13, 0.7}};
  EXPECT_EQ(counts.size(), expected.size());
  for (const auto& [next, p] : expected) {
    EXPECT_NEAR(counts[next], n * p, 4 * std::sqrt(n * p * (1 - p))) << next;
  }
}

TEST(Gridworld, CertainMovesDrawNothing) {
  Gridworld env({4, 3, 3, 0}, 4);
  Rng rng(10, 0, Stream::kMeasure);
  const auto state = rng.state();
  env.sample(0, kRight, rng);
  EXPECT_EQ(rng.state(), state);
}

TEST(Gridworld, TakesUpOnlyStatesOfItsGrid) {
  Gridworld env({3, 2, 2, 0}, 5);
  env.setState({2 * 5 + 1, 4});
  EXPECT_EQ(env.state(), (std::vector<double>{11, 4}));
  Rng rng(11, 0, Stream::kMeasure);
  double seen[2];
  const double right = kRight;
  EXPECT_TRUE(env.step(&right, rng, seen).terminated);
  for (const double cell : {-1.0, 0.5, 3.0, 15.0, 25.0, 1e300}) {
    EXPECT_EQ(errorOf([&] {
                env.setState({cell, 0});
              }),
              "a state of gridworld is in cell " + formatNumber(cell) +
                  ", which the grid does not have.");
  }
}

// the family as a program sets it up
struct Family {
  GridworldFamily family;
  Settings settings;
  explicit Family(const std::vector<std::string>& assignments, std::uint64_t seed = 0) {
    family.bind(settings);
    for (const std::string& one : assignments) settings.assign(one);
    family.build(seed);
  }
};

TEST(GridworldFamily, HoldsThePapersTasksByDefault) {
  const Family f({});
  ASSERT_EQ(f.family.numTasks(), 5);
  EXPECT_EQ(f.family.stride(), 8);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(f.family.task(i).size, 4 + i);
    EXPECT_EQ(f.family.task(i).landmark_row, 3 + i);
    EXPECT_EQ(f.family.task(i).landmark_column, 3 + i);
    EXPECT_EQ(f.family.task(i).slip, 0);
    EXPECT_EQ(f.family.make(i)->spec().horizon, 4 * (4 + i));
  }
  EXPECT_EQ(f.family.taskName(0), "grid_4x4");
  EXPECT_EQ(f.family.taskDescription(1), "5x5 cells, landmark at row 4, column 4");
}

TEST(GridworldFamily, SettingsReachTheTasks) {
  const Family f({"sizes:=[3, 6]", "landmark:=centre", "slip:=[0, 0.25]"});
  EXPECT_EQ(f.family.stride(), 6);
  EXPECT_EQ(f.family.task(0).landmark_row, 1);
  EXPECT_EQ(f.family.task(1).landmark_column, 3);
  EXPECT_EQ(f.family.task(1).slip, 0.25);
  EXPECT_EQ(f.family.taskDescription(1), "6x6 cells, landmark at row 3, column 3, slip 0.25");
}

TEST(GridworldFamily, RandomLandmarksFollowTheSeedAndSpread) {
  const std::vector<std::string> random = {"landmark:=random", "sizes:=[3, 3, 3, 3, 3]"};
  std::set<Cell> seen;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Family a(random, seed), b(random, seed);
    for (int i = 0; i < 5; ++i) {
      const Cell cell{a.family.task(i).landmark_row, a.family.task(i).landmark_column};
      EXPECT_EQ(cell, (Cell{b.family.task(i).landmark_row, b.family.task(i).landmark_column}));
      EXPECT_GE(std::min(cell.first, cell.second), 0);
      EXPECT_LT(std::max(cell.first, cell.second), 3);
      seen.insert(cell);
    }
  }
  EXPECT_EQ(seen.size(), 9u);
}

TEST(GridworldFamily, BadSettingsAreRefused) {
  const auto refused = [](const std::vector<std::string>& assignments) {
    return errorOf([&] { Family f(assignments); });
  };
  EXPECT_EQ(refused({"sizes:=[4, 1]"}),
            "environment.sizes is '[4, 1]' (given as sizes:=[4, 1]) but must be a list of whole "
            "numbers, from 2 to 512.");
  EXPECT_NE(refused({"sizes:=513"}), "(no error)");
  EXPECT_EQ(refused({"landmark:=middle"}),
            "environment.landmark is 'middle' (given as landmark:=middle) but must be one of "
            "corner, centre, random.");
  EXPECT_EQ(refused({"slip:=1"}),
            "environment.slip is '1' (given as slip:=1) but must be a list of numbers, from 0 to "
            "below 1.");
  EXPECT_EQ(refused({"slip:=[0.1, 0.2]"}),
            "environment.slip has 2 values for 5 tasks: give one, or one for each task.");
}

TEST(Registry, KnowsTheGridworldAndListsItForUnknownNames) {
  EXPECT_NE(envFamilies().at("gridworld")(), nullptr);
  const std::string known = " Known are " + join(envFamilies().names()) + ".";
  EXPECT_EQ(errorOf([] { envFamilies().at("gridwrld")(); }),
            "unknown environment 'gridwrld': did you mean 'gridworld'?" + known);
  EXPECT_EQ(errorOf([] { envFamilies().at("moon_landing")(); }),
            "unknown environment 'moon_landing'." + known);
}

}  // namespace
}  // namespace pmeta
