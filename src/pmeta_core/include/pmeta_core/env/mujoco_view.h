#pragma once

#include "pmeta_core/env/mujoco_model.h"

namespace pmeta {

/// From where a model is looked at, and what the view follows.
struct MujocoView {
  /// Index of the body that is followed; 0 (the world) where the model stands in one place.
  int body = 0;
  double elevation = 0;  ///< above the horizon, rad; 0: straight from the side
  double width = 0;      ///< m, at least so much of the floor is seen along x
  double depth = 0;      ///< m, the same along y; 0 where elevation is
};

/// The view of the model's first camera that is fixed to the world or follows a body (mode fixed,
/// track or trackcom), always from the side of -y. Without one, the body is the first that moves
/// about, and the elevation 0 for a model all of whose joints move in the plane of x and z, else 40
/// degrees. The size is that of the model at rest and of the room that it needs to move.
MujocoView viewOf(const MujocoModel& model);

}  // namespace pmeta
