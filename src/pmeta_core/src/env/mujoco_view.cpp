#include "pmeta_core/env/mujoco_view.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr double kDegree = 3.141592653589793 / 180;
constexpr double kUsual = 40 * kDegree;
constexpr double kSteepest = 80 * kDegree;
constexpr double kFlat = 10 * kDegree;  // what looks nearly from the side does so wholly

bool movesInPlane(const mjModel* m, const mjData* rest) {
  constexpr double kAligned = 1e-6;
  for (int joint = 0; joint < m->njnt; ++joint) {
    const double along_y = std::abs(rest->xaxis[3 * joint + 1]);
    const int type = m->jnt_type[joint];
    const bool hinge = type == mjJNT_HINGE && along_y > 1 - kAligned;
    const bool slide = type == mjJNT_SLIDE && along_y < kAligned;
    if (!hinge && !slide) return false;
  }
  return true;
}

// the first child of the world that its own joints move about
int movingBody(const mjModel* m) {
  for (int joint = 0; joint < m->njnt; ++joint) {
    const int type = m->jnt_type[joint];
    const int body = m->jnt_bodyid[joint];
    if (m->body_parentid[body] == 0 && (type == mjJNT_FREE || type == mjJNT_SLIDE)) return body;
  }
  return 0;
}

// an angle above the horizon, from 0 to kSteepest
double elevationOf(const double* camera) {
  const double elevation = std::asin(std::clamp(camera[8], -1.0, 1.0));
  return elevation < kFlat ? 0 : std::min(elevation, kSteepest);
}

// how far geoms of bodies reach from `center`, in the plane or (`up`) above the floor
double reach(const mjModel* m, const mjData* rest, const double* center, bool up) {
  double farthest = 0;
  for (int geom = 0; geom < m->ngeom; ++geom) {
    if (m->geom_bodyid[geom] == 0) continue;
    const double* at = rest->geom_xpos + 3 * geom;
    const double distance = up ? at[2] : std::hypot(at[0] - center[0], at[1] - center[1]);
    farthest = std::max(farthest, distance + m->geom_rbound[geom]);
  }
  return farthest;
}

}  // namespace

MujocoView viewOf(const MujocoModel& model) {
  const mjModel* m = model.get();
  const std::unique_ptr<mjData, void (*)(mjData*)> rest(mj_makeData(m), mj_deleteData);
  if (rest == nullptr) throw Error("MuJoCo cannot pose the model " + model.source() + ".");
  mj_kinematics(m, rest.get());

  MujocoView view;
  view.body = movingBody(m);
  view.elevation = movesInPlane(m, rest.get()) ? 0 : kUsual;
  for (int camera = 0; camera < m->ncam; ++camera) {
    const int mode = m->cam_mode[camera];
    if (mode != mjCAMLIGHT_FIXED && mode != mjCAMLIGHT_TRACK && mode != mjCAMLIGHT_TRACKCOM) {
      continue;
    }
    // what is fixed to a body that turns would turn with it
    if (mode == mjCAMLIGHT_FIXED && m->cam_bodyid[camera] != 0) continue;
    view.body = m->cam_bodyid[camera];
    view.elevation = elevationOf(m->cam_mat0 + 9 * camera);
    break;
  }
  const double* center = rest->xpos + 3 * view.body;
  const double around = reach(m, rest.get(), center, false);
  const double height = reach(m, rest.get(), center, true);
  if (view.elevation == 0) {
    view.width = std::max(3.4 * around, 1.8 * height);
  } else {
    view.width = 2.8 * around;
    view.depth = 2.3 * around;
  }
  if (!(view.width > 0)) throw Error("the model " + model.source() + " has no geoms to be drawn.");
  return view;
}

}  // namespace pmeta
