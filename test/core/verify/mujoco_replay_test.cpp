#include <gtest/gtest.h>

#include <functional>

#include "../support.h"
#include "pmeta_core/verify/trajectory_check.h"
#include "recorded_file.h"

namespace pmeta {
namespace {

using test::Altered;
using test::errorOf;
using test::Lines;
using test::linesOf;

const std::string kData = PMETA_TEST_DATA "/";

struct Recorded {
  const char* kind;
  const char* tasks;  ///< "" where there are none
  int sequences;
  long steps;
  std::size_t columns;
  double exactness;  ///< of a single step, but for columns in single precision

  std::string path() const { return kData + kind + "_traj.csv.gz"; }
  std::string tasksPath() const { return *tasks == 0 ? "" : kData + tasks; }
  TrajectoryReport check(const std::string& file) const {
    return checkTrajectories(kind, file, tasksPath());
  }
};

const Recorded kHalfCheetah = {"half_cheetah", "", 4, 160, 56, 1e-10};
const Recorded kAnt = {"ant", "", 3, 126, 83, 1e-10};
const Recorded kWalker2d = {"walker2d", "", 4, 210, 52, 1e-10};
const Recorded kWalker2dParams = {
    "walker2d_params", "walker2d_params_tasks.csv.gz", 6, 150, 52, 1e-10};
const Recorded kSparsePoint = {"sparse_point", "sparse_point_goals.csv.gz", 20, 600, 5, 1e-12};

class Replay : public testing::TestWithParam<Recorded> {};

TEST_P(Replay, FollowsTheOriginal) {
  const Recorded& recorded = GetParam();
  const TrajectoryReport report = recorded.check(recorded.path());
  EXPECT_TRUE(report.ok()) << trajectoryTable(report);
  EXPECT_EQ(report.sequences, recorded.sequences);
  EXPECT_EQ(report.steps, recorded.steps);
  ASSERT_EQ(report.columns.size(), recorded.columns);
  EXPECT_EQ(report.columns.back().column, "done");
  EXPECT_EQ(report.columns.back().single_step.value, 0);
  for (const ColumnErrors& column : report.columns) {
    const bool single = recorded.kind == kHalfCheetah.kind && column.column.rfind("obs_", 0) == 0;
    const bool acceleration = column.column.rfind("warm_", 0) == 0;
    const double exactness = single || acceleration ? 1e-6 : recorded.exactness;
    EXPECT_LE(column.single_step.value, exactness) << column.column;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Replay,
                         testing::Values(kHalfCheetah, kAnt, kWalker2d, kWalker2dParams,
                                         kSparsePoint),
                         [](const auto& info) { return std::string(info.param.kind); });

TEST(MujocoReplay, OneAlteredNumberIsNamedByRowAndColumn) {
  struct Change {
    const Recorded& recorded;
    long line;
    const char* column;
    double add;
  };
  for (const Change& c :
       {Change{kHalfCheetah, 50, "qpos_3", 2e-9}, Change{kHalfCheetah, 60, "obs_16", 1e-4},
        Change{kHalfCheetah, 70, "reward_vel", 1e-6}, Change{kHalfCheetah, 80, "torso_z", 2e-9},
        Change{kAnt, 100, "contact_cost", 2e-7}, Change{kAnt, 100, "vel_x", 2e-7},
        Change{kAnt, 101, "obs_26", 2e-9}, Change{kAnt, 12, "done", 1},
        Change{kWalker2d, 30, "qvel_8", -2e-9}, Change{kWalker2d, 31, "reward", 2e-7},
        Change{kWalker2dParams, 90, "obs_0", 2e-9}, Change{kSparsePoint, 40, "pos_x", 2e-12},
        Change{kSparsePoint, 41, "reward_sparse", 2e-12}}) {
    double value = 0;
    const Altered file(c.recorded.path(), [&](Lines& lines) {
      const auto& header = lines.front();
      const auto column = std::find(header.begin(), header.end(), c.column) - header.begin();
      std::string& cell = lines[c.line - 1][column];
      value = std::stod(cell) + c.add;
      cell = formatNumber(value);
    });
    const TrajectoryReport report = c.recorded.check(file.path());
    ASSERT_FALSE(report.ok()) << c.column;
    EXPECT_EQ(report.first->line, c.line);
    EXPECT_EQ(report.first->column, c.column);
    EXPECT_EQ(report.first->recorded, value);
    EXPECT_NEAR(report.first->simulated, value - c.add, 1e-6);
  }
}

// an action has been applied to the wrong motor, or by another amount
TEST(MujocoReplay, AlteredActionsShow) {
  for (const Recorded* recorded : {&kHalfCheetah, &kAnt, &kWalker2d, &kWalker2dParams}) {
    const Altered file(recorded->path(), [](Lines& lines) {
      const auto column = std::find(lines[0].begin(), lines[0].end(), "act_1") - lines[0].begin();
      std::swap(lines[3][column], lines[3][column + 1]);
    });
    const TrajectoryReport report = recorded->check(file.path());
    ASSERT_FALSE(report.ok()) << recorded->kind;
    EXPECT_EQ(report.first->line, 4);
  }
}

// the ant's velocity is that of positions as the steps left them: the row before counts
TEST(MujocoReplay, TheStalePositionCounts) {
  const Altered file(kAnt.path(), [](Lines& lines) {
    const auto column = std::find(lines[0].begin(), lines[0].end(), "torso_x") - lines[0].begin();
    std::string& cell = lines[14][column];
    cell = formatNumber(std::stod(cell) + 1e-3);
  });
  const TrajectoryReport report = kAnt.check(file.path());
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.first->column, "torso_x");
  EXPECT_EQ(report.first->line, 15);
  // the number itself, and in the next row vel_x and four rewards that follow from it
  EXPECT_EQ(report.deviations, 2 + 5);
}

TEST(MujocoReplay, MissingColumnsAreNamed) {
  for (const auto& [recorded, column] :
       {std::pair{&kHalfCheetah, "target_vel"}, std::pair{&kHalfCheetah, "warm_8"},
        std::pair{&kAnt, "act_7"}, std::pair{&kAnt, "reward_back_nocontact"},
        std::pair{&kWalker2d, "alive"}, std::pair{&kWalker2dParams, "task"},
        std::pair{&kSparsePoint, "act_y"}}) {
    const Altered file(recorded->path(), [column = column](Lines& lines) {
      *std::find(lines[0].begin(), lines[0].end(), column) = "else";
    });
    EXPECT_EQ(
        errorOf([&, recorded = recorded] { recorded->check(file.path()); }),
        file.path() + " line 1 names no column '" + column + "': is this the right kind of file?");
  }
}

TEST(MujocoReplay, TasksAreAskedForWhereTheyAreNeeded) {
  EXPECT_EQ(errorOf([] { checkTrajectories("walker2d_params", kWalker2dParams.path()); }),
            "trajectories of walker2d_params need the file of their tasks: give --tasks FILE, e.g. "
            "walker2d_params_tasks.csv.");
  EXPECT_EQ(errorOf([] { checkTrajectories("sparse_point", kSparsePoint.path()); }),
            "trajectories of sparse_point need the file of their tasks: give --tasks FILE, e.g. "
            "sparse_point_goals.csv.");
  EXPECT_EQ(errorOf([] { checkTrajectories("ant", kAnt.path(), "tasks.csv"); }),
            "trajectories of ant have no tasks: leave out --tasks.");
}

TEST(MujocoReplay, TheWalkersTasksAreChecked) {
  const std::string tasks = kWalker2dParams.tasksPath();
  const auto refused = [&](const std::function<void(Lines&)>& change) {
    const Altered file(tasks, change);
    const std::string error =
        errorOf([&] { checkTrajectories("walker2d_params", kWalker2dParams.path(), file.path()); });
    return error.substr(error.find(" line") == std::string::npos ? 0 : error.find(" line"));
  };
  EXPECT_EQ(refused([](Lines& l) { l[2][1] = "body_pos"; }),
            " line 3 column field is 'body_pos' but must be body_mass.");
  EXPECT_EQ(refused([](Lines& l) { std::swap(l[2], l[3]); }),
            " line 3 column row is '2' but must be 1 here.");
  EXPECT_EQ(refused([](Lines& l) { l[2][4] = "-1"; }),
            " line 3 column multiplier is '-1' but must be a number, above 0.");
  const std::string wrong = refused([](Lines& l) { l[2][4] = "2"; });
  EXPECT_NE(wrong.find("the model's figure times the multiplier"), std::string::npos) << wrong;
  EXPECT_NE(refused([](Lines& l) { l.pop_back(); }).find("must have 65 for each task."),
            std::string::npos);
  EXPECT_EQ(refused([](Lines&) {}), "(no error)");
}

// a factor that is a little off shows: the tasks do reach the models
TEST(MujocoReplay, TheWalkersTasksCount) {
  for (const long line : {3, 20, 40, 55}) {
    const Altered file(kWalker2dParams.tasksPath(), [&](Lines& lines) {
      for (const int column : {4, 5}) {
        std::string& cell = lines[line - 1][column];
        cell = formatNumber(std::stod(cell) * 1.01);
      }
    });
    const TrajectoryReport report =
        checkTrajectories("walker2d_params", kWalker2dParams.path(), file.path());
    EXPECT_FALSE(report.ok()) << line;
    EXPECT_EQ(report.first->task, 0);
  }
}

}  // namespace
}  // namespace pmeta
