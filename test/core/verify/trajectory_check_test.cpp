#include "pmeta_core/verify/trajectory_check.h"

#include <gtest/gtest.h>

#include <functional>

#include "../support.h"
#include "pmeta_core/verify/model_check.h"
#include "recorded_file.h"

namespace pmeta {
namespace {

using test::Altered;
using test::errorOf;
using test::Lines;
using test::readFile;
using test::TempDir;
using test::writeFile;

constexpr char kCartPole[] = PMETA_TEST_DATA "/cartpole_traj.csv.gz";
constexpr char kMountainCar[] = PMETA_TEST_DATA "/mountaincar_traj.csv.gz";

TEST(TrajectoryCheck, CartPoleFollowsGym) {
  const TrajectoryReport report = checkTrajectories("cartpole", kCartPole);
  EXPECT_TRUE(report.ok()) << trajectoryTable(report);
  EXPECT_EQ(report.sequences, 30);
  EXPECT_EQ(report.steps, 1976);
  EXPECT_EQ(report.unbounded_steps, 1);  // the short pole after step 50
  ASSERT_EQ(report.columns.size(), 6u);
  for (const ColumnErrors& column : report.columns) {
    EXPECT_LE(column.single_step.value, 1e-12) << column.column;
    EXPECT_LE(column.open_loop.value, 1e-5) << column.column;
  }
  EXPECT_EQ(report.columns[4].column, "reward");
  EXPECT_EQ(report.columns[4].single_step.value, 0);
  EXPECT_EQ(report.columns[5].column, "done");
  EXPECT_EQ(report.columns[5].open_loop.value, 0);
}

TEST(TrajectoryCheck, MountainCarFollowsGym) {
  const TrajectoryReport report = checkTrajectories("mountaincar", kMountainCar);
  EXPECT_TRUE(report.ok()) << trajectoryTable(report);
  EXPECT_EQ(report.sequences, 30);
  EXPECT_EQ(report.steps, 5273);
  EXPECT_EQ(report.unbounded_steps, 0);
  ASSERT_EQ(report.columns.size(), 4u);
  for (const ColumnErrors& column : report.columns) {
    EXPECT_LE(column.single_step.value, 1e-12) << column.column;
    EXPECT_LE(column.open_loop.value, 1e-12) << column.column;
  }
}

TEST(TrajectoryCheck, PlainAndGzipFilesGiveTheSameReport) {
  const Altered plain(kCartPole, [](Lines&) {});
  TrajectoryReport report = checkTrajectories("cartpole", plain.path());
  report.path = kCartPole;
  EXPECT_EQ(trajectoryTable(report), trajectoryTable(checkTrajectories("cartpole", kCartPole)));
}

TEST(TrajectoryCheck, OneAlteredNumberIsNamedByRowAndColumn) {
  struct Change {
    const char* kind;
    const char* path;
    long line;
    int column;
    double add;
  };
  for (const Change& c :
       {Change{"cartpole", kCartPole, 700, 5, 1e-11}, Change{"cartpole", kCartPole, 1000, 4, -1},
        Change{"cartpole", kCartPole, 321, 8, -1}, Change{"cartpole", kCartPole, 322, 9, 1},
        Change{"mountaincar", kMountainCar, 4000, 4, 2e-12},
        Change{"mountaincar", kMountainCar, 5304, 5, 1e-9},
        Change{"mountaincar", kMountainCar, 77, 6, 1}}) {
    double recorded = 0;
    std::string column;
    const Altered file(c.path, [&](Lines& lines) {
      std::string& cell = lines[c.line - 1][c.column];
      recorded = std::stod(cell) + c.add;
      cell = formatNumber(recorded);
      column = lines[0][c.column];
    });
    const TrajectoryReport report = checkTrajectories(c.kind, file.path());
    ASSERT_FALSE(report.ok()) << column;
    EXPECT_EQ(report.first->line, c.line);
    EXPECT_EQ(report.first->column, column);
    EXPECT_EQ(report.first->mode, ReplayMode::kSingleStep);
    EXPECT_EQ(report.first->recorded, recorded);
    EXPECT_NEAR(report.first->simulated, recorded - c.add, 1e-14);
    const std::string table = trajectoryTable(report);
    EXPECT_NE(table.find("NOT ok: "), std::string::npos);
    EXPECT_NE(table.find("first line " + std::to_string(c.line) + ", column " + column + " (task "),
              std::string::npos)
        << table;
  }
}

TEST(TrajectoryCheck, AnAlteredStartShowsInTheRowAfter) {
  const Altered file(kMountainCar, [](Lines& lines) { lines[1][4] = "-0.5"; });
  const TrajectoryReport report = checkTrajectories("mountaincar", file.path());
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.first->line, 3);
  EXPECT_EQ(report.first->column, "position");
  EXPECT_EQ(report.first->t, 1);
}

// a start that is wrong by less than one step shows, of a pole that amplifies it
TEST(TrajectoryCheck, TheOpenLoopIsJudgedToo) {
  const Altered file(kCartPole, [](Lines& lines) {
    for (auto& cells : lines) {
      if (cells[0] != "4" || cells[1] != "14" || cells[2] != "0") continue;
      cells[6] = formatNumber(std::stod(cells[6]) + 2e-13);
    }
  });
  const TrajectoryReport report = checkTrajectories("cartpole", file.path());
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.first->mode, ReplayMode::kOpenLoop);
  EXPECT_EQ(report.first->task, 4);
  EXPECT_EQ(report.first->seq, 14);
  EXPECT_GT(report.first->t, 1);
  EXPECT_EQ(report.first->tolerance, 1e-11);
  EXPECT_NE(trajectoryTable(report).find("from the sequence's start"), std::string::npos);
}

TEST(TrajectoryCheck, TasksMayComeFromAFile) {
  const TempDir dir;
  writeFile(dir / "tasks.csv",
            "task,zeta,force,gravity\n0,3,0.001,0.0025\n1,3.5,0.001,0.0025\n2,4,0.001,0.0025\n"
            "3,4.5,0.001,0.0025\n4,5,0.001,0.0025\n");
  EXPECT_TRUE(checkTrajectories("mountaincar", kMountainCar, dir / "tasks.csv").ok());
  writeFile(dir / "tasks.csv",
            "task,zeta,force,gravity\n0,3,0.001,0.0025\n1,3.5,0.001,0.0025\n2,4,0.001,0.0025\n"
            "3,4.5,0.001,0.0025\n4,5,0.002,0.0025\n");
  const TrajectoryReport wrong = checkTrajectories("mountaincar", kMountainCar, dir / "tasks.csv");
  ASSERT_FALSE(wrong.ok());
  EXPECT_EQ(wrong.first->task, 4);
}

TEST(TrajectoryCheck, BadTasksAreRefused) {
  const TempDir dir;
  const std::string path = dir / "tasks.csv";
  const auto refused = [&](const std::string& text) {
    writeFile(path, text);
    return errorOf([&] { checkTrajectories("cartpole", kCartPole, path); });
  };
  EXPECT_EQ(refused("task,force_mag,masspole\n0,1,1\n"),
            path + " line 1 names no column 'length': is this the right kind of file?");
  EXPECT_EQ(refused("task,force_mag,masspole,length\n0,1,1,0\n"),
            path + " line 2 column length is '0' but must be a number, above 0.");
  EXPECT_EQ(refused("task,force_mag,masspole,length\n1,1,1,1\n"),
            path + " line 2 column task is '1' but must be 0: tasks count from 0.");
  EXPECT_EQ(refused("task,force_mag,masspole,length\n"), path + " holds no tasks, only a header.");
  EXPECT_EQ(refused("task,force_mag,masspole,length\n0,20,0.1,0.5\n"),
            std::string(kCartPole) +
                " line 409 column task is '1' but must be a whole number, from 0 to 0.");
}

TEST(TrajectoryCheck, BadFilesAreRefusedByLineAndColumn) {
  const auto refused = [](const std::function<void(Lines&)>& change) {
    const Altered file(kCartPole, change);
    const std::string error = errorOf([&] { checkTrajectories("cartpole", file.path()); });
    return error.compare(0, file.path().size(), file.path()) == 0 ? error.substr(file.path().size())
                                                                  : error;
  };
  EXPECT_EQ(refused([](Lines& l) { l[0][5] = "speed"; }),
            " line 1 names no column 'x_dot': is this the right kind of file?");
  EXPECT_EQ(refused([](Lines& l) { l[11].pop_back(); }),
            " line 12 has 9 cells for 10 columns: it ends before column 'done'.");
  EXPECT_EQ(refused([](Lines& l) { l[11][6] = "0.1O"; }),
            " line 12 column theta is '0.1O' but must be a number.");
  EXPECT_EQ(refused([](Lines& l) { l[11][3] = "2"; }),
            " line 12 column action is '2' but must be a whole number, from 0 to 1.");
  EXPECT_EQ(refused([](Lines& l) { l[11][0] = "5"; }),
            " line 12 column task is '5' but must be a whole number, from 0 to 4.");
  EXPECT_EQ(refused([](Lines& l) { l.erase(l.begin() + 11); }),
            " line 12 column t is '11' but must be 10, the step after the row before.");
  EXPECT_EQ(refused([](Lines& l) { l.erase(l.begin() + 1); }),
            " line 2 column t is '1' but must be 0 where a sequence begins.");
  EXPECT_EQ(refused([](Lines& l) { l.resize(1); }), " holds no rows, only a header.");
}

TEST(TrajectoryCheck, OtherKindsAndFilesAreRefused) {
  EXPECT_EQ(errorOf([] { checkTrajectories("cart_pole", kCartPole); }),
            "unknown trajectories 'cart_pole': did you mean 'cartpole'? Known are " +
                join(trajectoryKinds()) + ", " + join(modelKinds()) + ".");
  EXPECT_EQ(
      errorOf([] { checkTrajectories("cartpole", kMountainCar); }),
      std::string(kMountainCar) + " line 1 names no column 'x': is this the right kind of file?");
  EXPECT_EQ(errorOf([] { checkTrajectories("cartpole", "/nowhere/a.csv"); }),
            "the table /nowhere/a.csv cannot be read (No such file or directory).");
  const TempDir dir;
  const std::string whole = readFile(kCartPole);
  writeFile(dir / "cut.csv.gz", whole.substr(0, whole.size() / 2));
  EXPECT_EQ(errorOf([&] { checkTrajectories("cartpole", dir / "cut.csv.gz"); }),
            "cannot read " + dir.path() +
                "/cut.csv.gz (its compressed data ends too early: is it cut short?).");
}

}  // namespace
}  // namespace pmeta
