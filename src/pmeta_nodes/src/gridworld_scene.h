#pragma once

#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include "pmeta_core/env/gridworld.h"

namespace pmeta_nodes {

/// One grid to draw; cell (r, c) is state r * stride + c.
struct GridGeometry {
  pmeta::GridworldTask task;
  int stride = 0;
  std::string name;  ///< the task's, e.g. "grid_4x4"
};

/// What is known of one policy on one task. Null: nothing yet.
struct PolicyView {
  pmeta_msgs::Trajectory::ConstPtr episode;  ///< must be drawable, see trajectoryProblem()
  pmeta_msgs::TaskReturn::ConstPtr result;
};

/// Both policies on one task.
struct TaskView {
  PolicyView personal;
  PolicyView meta;
};

/// All that the scene shows.
struct SceneContent {
  std::string experiment;
  int rounds = 0;                ///< C
  bool has_trajectories = true;  ///< false: agents send none, and the title says so
  bool has_meta = true;          ///< false: independent training, the lower row says so
  std::vector<TaskView> tasks;   ///< one for each grid
  pmeta_msgs::RoundSummary::ConstPtr summary;  ///< null: no round yet
};

/// The scene, in its world frame `pmeta`: a box of this size around the origin, seen from +z.
/// It is the same for any number of tasks, so that one rviz view fits all experiments.
constexpr double kSceneWidth = 12;
constexpr double kSceneHeight = 7.2;
constexpr char kWorldFrame[] = "pmeta";

/// "task_<i>/personal" or "task_<i>/meta" (`policy` as in Trajectory.msg).
std::string gridFrame(int task, int policy);

/// Side of every grid in the scene's units; grids with more cells have smaller cells.
double gridSide(int num_tasks);

/// Frames of all grids in the world frame: personal above meta, tasks side by side. The origin is
/// the upper left corner, so row r lies at y = -r.
std::vector<geometry_msgs::TransformStamped> gridFrames(int num_tasks);

/// Why this message cannot be drawn on this grid, in a sentence; "" if it can.
std::string trajectoryProblem(const pmeta_msgs::Trajectory& trajectory, const GridGeometry& grid);

/// The whole scene. Namespaces name layers (cells, arrows, paths, ...), ids are 2 * task + (0
/// personal, 1 meta): every call gives the same set of them, with DELETE for what is not there.
visualization_msgs::MarkerArray gridworldScene(const std::vector<GridGeometry>& grids,
                                               const SceneContent& content);

}  // namespace pmeta_nodes
