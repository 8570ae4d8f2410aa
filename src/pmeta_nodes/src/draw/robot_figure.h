#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <string>

#include "pmeta_core/env/mujoco_kinematics.h"
#include "pmeta_nodes/figure.h"

namespace pmeta_nodes {

/// A place in a model's world, m.
struct Position {
  double x = 0;  ///< forward
  double y = 0;  ///< to the left
  double z = 0;  ///< upwards
};

/// How a model is drawn.
struct RobotPicture {
  std::string frame;  ///< that it is drawn in
  int id = 0;         ///< of the robot: markers of different ids have different names
  Color color;        ///< of its darkest part
  double scale = 1;   ///< units of the frame for 1 m
  bool shown = true;  ///< false: its markers are deleted
  Position origin;    ///< whose x and y are drawn at the frame's origin
};

/// The model's geoms as `kinematics` has posed them: one marker for each geom, of a capsule its
/// cylinder (namespace "geoms"), and one for the ends of all capsules of a radius ("caps").
void drawGeoms(const pmeta::MujocoKinematics& kinematics, const RobotPicture& picture,
               visualization_msgs::MarkerArray& scene);

/// Height (m) that no geom reaches beyond, as `kinematics` has posed them.
double topOf(const pmeta::MujocoKinematics& kinematics);

}  // namespace pmeta_nodes
