#pragma once

#include <pmeta_msgs/Trajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>

#include "pmeta_nodes/scene_parts.h"

namespace pmeta_nodes {

/// Where the map of a policy's action values is drawn.
struct ActionValuePlace {
  std::string frame;  ///< of the lane
  Point corner;       ///< the lower left one of the square, in `frame`
  double side = 0;    ///< of the square
  double letter = 0;  ///< height of letters
  int cells = 0;      ///< along each axis, where the episode has more values; at least 2
};

/// A map's width with key and numbers is its side and that many of it.
constexpr double kActionValueKey = 0.95;

/// A policy's action values at the start of its episode (Trajectory::action_values): a square of
/// colours, from the lowest to the highest value of the map, with ticks at -1, 0 and 1 along both
/// axes, a key with the lowest and highest value, and a dot on the action that the policy takes
/// there. Namespaces "action values", "action value axes" and "action value texts".
void drawActionValues(const ActionValuePlace& place, int task, int policy, const PolicyView& view,
                      visualization_msgs::MarkerArray& scene);

/// Why a message's action values cannot be drawn, in a sentence; "" if they can, or are not there.
std::string actionValueProblem(const pmeta_msgs::Trajectory& trajectory);

}  // namespace pmeta_nodes
