#include "view/gridworld_scene.h"
#include "pmeta_nodes/scene_parts.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;
using pmeta_msgs::Trajectory;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

GridGeometry geometry(int size = 4, int stride = 8) {
  pmeta::GridworldTask task;
  task.size = size;
  task.landmark_row = task.landmark_column = size - 1;
  return {task, stride, "grid_" + std::to_string(size) + "x" + std::to_string(size)};
}

/// Along the top row, then down to the landmark.
Trajectory walk(const GridGeometry& grid, int policy = Trajectory::PERSONAL) {
  Trajectory message;
  message.policy = policy;
  message.round = 3;
  message.observation_size = 2;
  message.action_size = 1;
  message.observations = {0, 0};
  const int last = grid.task.size - 1;
  for (int step = 1; step <= 2 * last; ++step) {
    message.observations.push_back(std::max(0, step - last));
    message.observations.push_back(std::min(step, last));
    message.actions.push_back(step <= last ? 3 : 1);
    message.rewards.push_back(step - 2 * last);
  }
  message.terminated = true;
  message.state_values.assign(grid.stride * grid.stride, kNan);
  message.greedy_actions.assign(grid.stride * grid.stride, -1);
  for (int row = 0; row < grid.task.size; ++row) {
    for (int column = 0; column < grid.task.size; ++column) {
      if (row == last && column == last) continue;
      message.state_values[row * grid.stride + column] = row + column;
      message.greedy_actions[row * grid.stride + column] = column < last ? 3 : 1;
    }
  }
  return message;
}

Trajectory::ConstPtr shared(const Trajectory& message) {
  return boost::make_shared<Trajectory>(message);
}

SceneContent content(int tasks) {
  SceneContent content;
  content.experiment = "gridworld";
  content.rounds = 10;
  content.tasks.resize(tasks);
  return content;
}

const Marker& find(const MarkerArray& scene, const std::string& ns, int id) {
  for (const Marker& marker : scene.markers) {
    if (marker.ns == ns && marker.id == id) return marker;
  }
  throw std::out_of_range(ns + " " + std::to_string(id));
}

std::set<std::pair<std::string, int>> names(const MarkerArray& scene) {
  std::set<std::pair<std::string, int>> names;
  for (const Marker& marker : scene.markers) names.insert({marker.ns, marker.id});
  return names;
}

/// Colour drawn last over (x, y): the topmost triangle there.
std_msgs::ColorRGBA colorAt(const Marker& marker, double x, double y) {
  std_msgs::ColorRGBA color;
  double top = -1;
  for (std::size_t i = 0; i + 2 < marker.points.size(); i += 3) {
    const auto& p = marker.points;
    const auto turn = [&](const geometry_msgs::Point& a, const geometry_msgs::Point& b) {
      return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
    };
    const double u = turn(p[i], p[i + 1]), v = turn(p[i + 1], p[i + 2]), w = turn(p[i + 2], p[i]);
    const bool inside = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
    if (inside && p[i].z > top) {
      top = p[i].z;
      color = marker.colors[i];
    }
  }
  return color;
}

double luminance(const std_msgs::ColorRGBA& c) {
  return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}

TEST(GridworldScene, KeepsTheSameMarkersWhateverIsKnown) {
  const std::vector<GridGeometry> grids = {geometry(4), geometry(8)};
  SceneContent scene = content(2);
  const auto empty = names(gridworldScene(grids, scene));
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  scene.tasks[1].meta.episode = shared(walk(grids[1], Trajectory::META));
  scene.summary = boost::make_shared<RoundSummary>();
  const MarkerArray full = gridworldScene(grids, scene);
  EXPECT_EQ(empty, names(full));
  EXPECT_EQ(names(full).size(), full.markers.size()) << "two markers share a name";
}

TEST(GridworldScene, DeletesWhatIsNotThere) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  const MarkerArray markers = gridworldScene(grids, scene);
  for (const char* ns : {"paths", "arrows", "ends"}) {
    EXPECT_EQ(Marker::ADD, find(markers, ns, 0).action) << ns;
    EXPECT_EQ(Marker::DELETE, find(markers, ns, 1).action) << ns;
  }
  EXPECT_EQ(Marker::ADD, find(markers, "cells", 1).action);
  EXPECT_EQ(Marker::ADD, find(markers, "landmarks", 1).action);
}

TEST(GridworldScene, MarkersAreWhatRvizAccepts) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  for (const Marker& marker : gridworldScene(grids, scene).markers) {
    EXPECT_EQ(1, marker.pose.orientation.w);
    EXPECT_FALSE(marker.header.frame_id.empty());
    if (marker.action == Marker::DELETE) continue;
    EXPECT_GT(marker.color.a, 0);
    EXPECT_GT(marker.scale.z, 0);
    if (marker.type == Marker::TEXT_VIEW_FACING) {
      EXPECT_FALSE(marker.text.empty());
    } else {
      EXPECT_EQ(0u, marker.points.size() % 3);
      EXPECT_EQ(marker.points.size(), marker.colors.size());
    }
  }
}

TEST(GridworldScene, RowZeroIsOnTopAndHigherValuesAreLighter) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  const Marker cells = find(gridworldScene(grids, scene), "cells", 0);
  EXPECT_EQ("task_0/personal", cells.header.frame_id);
  const double cell = gridSide(1) / 4;
  const auto at = [&](int row, int column) {
    return luminance(colorAt(cells, (column + 0.5) * cell, -(row + 0.5) * cell));
  };
  // values of walk() are row + column
  EXPECT_LT(at(0, 0), at(1, 0));
  EXPECT_LT(at(1, 0), at(2, 1));
  EXPECT_NEAR(at(1, 2), at(2, 1), 1e-6);
  EXPECT_NEAR(at(3, 3), 1, 1e-6) << "the landmark has no value";
}

TEST(GridworldScene, BothPoliciesOfATaskShareOneColourScale) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  Trajectory meta = walk(grids[0], Trajectory::META);
  for (double& value : meta.state_values) value -= 100;
  scene.tasks[0].meta.episode = shared(meta);
  const MarkerArray markers = gridworldScene(grids, scene);
  const double x = gridSide(1) / 8;
  EXPECT_LT(luminance(colorAt(find(markers, "cells", 1), x, -x)),
            luminance(colorAt(find(markers, "cells", 0), x, -x)) - 0.3);
}

TEST(GridworldScene, EqualOrMissingValuesStillGiveColours) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  Trajectory flat = walk(grids[0]);
  for (double& value : flat.state_values) value = std::isnan(value) ? value : 0;
  scene.tasks[0].personal.episode = shared(flat);
  Trajectory bare = walk(grids[0], Trajectory::META);
  bare.state_values.clear();
  bare.greedy_actions.clear();
  scene.tasks[0].meta.episode = shared(bare);
  for (const Marker& marker : gridworldScene(grids, scene).markers) {
    for (const auto& color : marker.colors) {
      EXPECT_TRUE(std::isfinite(color.r) && std::isfinite(color.g) && std::isfinite(color.b));
    }
  }
}

TEST(GridworldScene, PathRunsThroughTheCentresOfItsCells) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  const Marker path = find(gridworldScene(grids, scene), "paths", 0);
  const double cell = gridSide(1) / 4;
  for (const auto& [row, column] : {std::pair(0, 0), {0, 1}, {0, 3}, {2, 3}, {3, 3}}) {
    EXPECT_GT(colorAt(path, (column + 0.5) * cell, -(row + 0.5) * cell).a, 0);
  }
  EXPECT_EQ(0, colorAt(path, 0.5 * cell, -1.5 * cell).a) << "a cell that was not visited";
}

TEST(GridworldScene, PersonalAndMetaPathsDifferInColour) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  scene.tasks[0].personal.episode = shared(walk(grids[0]));
  scene.tasks[0].meta.episode = shared(walk(grids[0], Trajectory::META));
  const MarkerArray markers = gridworldScene(grids, scene);
  const double x = gridSide(1) / 8;
  const auto personal = colorAt(find(markers, "paths", 0), x, -x);
  const auto meta = colorAt(find(markers, "paths", 1), x, -x);
  EXPECT_GT(
      std::abs(personal.r - meta.r) + std::abs(personal.g - meta.g) + std::abs(personal.b - meta.b),
      0.5);
}

TEST(GridworldScene, RunningInCirclesDoesNotMakeTheMessageLonger) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  Trajectory circling = walk(grids[0]);
  const auto pathLength = [&](int steps) {
    circling.observations = {0, 0};
    for (int step = 1; step <= steps; ++step) {
      circling.observations.push_back(0);
      circling.observations.push_back(step % 2);
    }
    circling.actions.assign(steps, 3);
    circling.rewards.assign(steps, -1);
    EXPECT_EQ("", trajectoryProblem(circling, grids[0]));
    scene.tasks[0].personal.episode = shared(circling);
    return find(gridworldScene(grids, scene), "paths", 0).points.size();
  };
  EXPECT_EQ(pathLength(2), pathLength(10000));
}

TEST(GridworldScene, AHugeGridStaysASmallMessage) {
  const std::vector<GridGeometry> grids = {geometry(512, 512)};
  SceneContent scene = content(1);
  Trajectory start = walk(grids[0]);
  start.observations.resize(2);
  start.actions.clear();
  start.rewards.clear();
  ASSERT_EQ("", trajectoryProblem(start, grids[0]));
  scene.tasks[0].personal.episode = shared(start);
  std::size_t points = 0;
  for (const Marker& marker : gridworldScene(grids, scene).markers) points += marker.points.size();
  EXPECT_LT(points, 100000u);
}

TEST(GridworldScene, FramesPutPersonalAboveMetaAndKeepGridsApart) {
  for (const int tasks : {1, 2, 5, 12, 40}) {
    const auto frames = gridFrames(tasks);
    const double side = gridSide(tasks);
    ASSERT_EQ(2u * tasks, frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const auto& a = frames[i].transform.translation;
      EXPECT_EQ(policyFrame(i / 2, i % 2 == 0 ? Trajectory::PERSONAL : Trajectory::META),
                frames[i].child_frame_id);
      EXPECT_GE(a.x, -kSceneWidth / 2);
      EXPECT_LE(a.x + side, kSceneWidth / 2);
      EXPECT_LE(a.y, kSceneHeight / 2);
      EXPECT_GE(a.y - side, -kSceneHeight / 2);
      for (std::size_t j = 0; j < i; ++j) {
        const auto& b = frames[j].transform.translation;
        EXPECT_TRUE(std::abs(a.x - b.x) > side || std::abs(a.y - b.y) > 1.2 * side)
            << tasks << " tasks: " << i << " over " << j;
      }
    }
    EXPECT_GT(frames[0].transform.translation.y, frames[1].transform.translation.y);
    EXPECT_EQ(frames[0].transform.translation.x, frames[1].transform.translation.x);
  }
}

TEST(GridworldScene, TextsSayRoundReturnsAndWhatIsMissing) {
  const std::vector<GridGeometry> grids = {geometry()};
  SceneContent scene = content(1);
  const auto text = [&](const std::string& ns, int id) {
    return find(gridworldScene(grids, scene), ns, id).text;
  };
  EXPECT_EQ("gridworld: waiting for round 1 of 10", text("title", 0));
  EXPECT_EQ("no round yet", text("returns", 0));

  TaskReturn result;
  result.round = 7;
  result.return_mean = -3.5;
  scene.tasks[0].meta.result = boost::make_shared<TaskReturn>(result);
  RoundSummary summary;
  summary.round = 7;
  summary.rounds = 10;
  summary.personal_return = -2.25;
  summary.meta_return = kNan;
  scene.summary = boost::make_shared<RoundSummary>(summary);
  EXPECT_EQ("gridworld: round 7 of 10", text("title", 0));
  EXPECT_EQ("mean personal return (PP) -2.25", text("title", 1));
  EXPECT_EQ("mean meta return (MP) -", text("title", 2));
  EXPECT_EQ("grid_4x4 meta (MP)", text("labels", 1));
  EXPECT_EQ("round 7, return -3.50", text("returns", 1));
  Trajectory lost = walk(grids[0], Trajectory::META);
  lost.truncated = true;
  scene.tasks[0].meta.episode = shared(lost);
  EXPECT_EQ("round 7, return -3.50, landmark not reached", text("returns", 1));

  scene.has_meta = false;
  EXPECT_EQ("no meta-policy here", text("returns", 1));
  EXPECT_EQ("", text("title", 2));
  scene.has_trajectories = false;
  EXPECT_NE(std::string::npos, text("title", 0).find("trajectories are switched off"));
}

TEST(TrajectoryProblem, AcceptsAnEpisodeWithAndWithoutTables) {
  Trajectory message = walk(geometry());
  EXPECT_EQ("", trajectoryProblem(message, geometry()));
  message.state_values.clear();
  message.greedy_actions.clear();
  EXPECT_EQ("", trajectoryProblem(message, geometry()));
}

TEST(TrajectoryProblem, NamesWhatDoesNotFit) {
  using Damage = std::function<void(Trajectory&)>;
  const std::pair<const char*, Damage> cases[] = {
      {"policy 0", [](Trajectory& m) { m.policy = 0; }},
      {"of size 3", [](Trajectory& m) { m.observation_size = 3; }},
      {"0 observations", [](Trajectory& m) { m.observations.clear(); }},
      {"13 observations", [](Trajectory& m) { m.observations.pop_back(); }},
      {"rewards for 6 steps", [](Trajectory& m) { m.rewards.pop_back(); }},
      {"5 actions", [](Trajectory& m) { m.actions.pop_back(); }},
      {"not a cell", [](Trajectory& m) { m.observations[2] = 4; }},
      {"not a cell", [](Trajectory& m) { m.observations[2] = -1; }},
      {"not a cell", [](Trajectory& m) { m.observations[2] = 0.5; }},
      {"not a cell", [](Trajectory& m) { m.observations[2] = kNan; }},
      {"step 1 moves more", [](Trajectory& m) { m.observations[3] = 3; }},
      {"table of 16", [](Trajectory& m) { m.state_values.resize(16); }},
      {"table of 65", [](Trajectory& m) { m.greedy_actions.resize(65); }},
      {"no action 4", [](Trajectory& m) { m.greedy_actions[0] = 4; }},
      {"no action -2", [](Trajectory& m) { m.greedy_actions[0] = -2; }},
  };
  for (const auto& [expected, damage] : cases) {
    Trajectory message = walk(geometry());
    damage(message);
    const std::string problem = trajectoryProblem(message, geometry());
    EXPECT_NE(std::string::npos, problem.find(expected)) << expected << " in: " << problem;
  }
}

}  // namespace
}  // namespace pmeta_nodes
