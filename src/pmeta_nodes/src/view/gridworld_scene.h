#pragma once

#include <string>
#include <vector>

#include "pmeta_core/env/gridworld.h"
#include "pmeta_nodes/scene.h"

namespace pmeta_nodes {

/// One grid to draw; cell (r, c) is state r * stride + c.
struct GridGeometry {
  pmeta::GridworldTask task;  ///< size, landmark and slip
  int stride = 0;             ///< cells along each side of the largest grid
  std::string name;           ///< the task's, e.g. "grid_4x4"
};

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

/// The gridworlds: cells coloured by value, greedy actions and the paths of both policies.
class GridworldScene : public Scene {
 public:
  GridworldScene(const pmeta::GridworldFamily& family, int num_tasks);  ///< as SceneMaker has it

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;

 private:
  std::vector<GridGeometry> grids_;
};

}  // namespace pmeta_nodes
