#include "pmeta_core/env/mujoco_kinematics.h"

#include <mujoco/mujoco.h>

#include <algorithm>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

GeomShape shapeOf(const mjModel* model, const std::string& source, int geom) {
  GeomShape shape;
  const char* name = mj_id2name(model, mjOBJ_GEOM, geom);
  if (name != nullptr) shape.name = name;
  switch (model->geom_type[geom]) {
    case mjGEOM_SPHERE:
      shape.type = GeomShape::Type::kSphere;
      break;
    case mjGEOM_CAPSULE:
      shape.type = GeomShape::Type::kCapsule;
      break;
    case mjGEOM_ELLIPSOID:
      shape.type = GeomShape::Type::kEllipsoid;
      break;
    case mjGEOM_CYLINDER:
      shape.type = GeomShape::Type::kCylinder;
      break;
    case mjGEOM_BOX:
      shape.type = GeomShape::Type::kBox;
      break;
    default:
      throw Error("the geom '" + shape.name + "' (number " + std::to_string(geom) +
                  ") of the model " + source +
                  " cannot be drawn: use spheres, capsules, ellipsoids, cylinders and boxes.");
  }
  std::copy_n(model->geom_size + 3 * geom, 3, shape.size.begin());
  const int material = model->geom_matid[geom];
  const float* rgba = material < 0 ? model->geom_rgba + 4 * geom : model->mat_rgba + 4 * material;
  std::copy_n(rgba, 3, shape.rgb.begin());
  return shape;
}

}  // namespace

void MujocoKinematics::Delete::operator()(mjData_* data) const { mj_deleteData(data); }

MujocoKinematics::MujocoKinematics(const MujocoModel& model)
    : model_(model.copy()), data_(mj_makeData(model_.get())) {
  if (data_ == nullptr) throw Error("MuJoCo cannot pose the model " + model_.source() + ".");
  const mjModel* m = model_.get();
  for (int geom = 0; geom < m->ngeom; ++geom) {
    if (m->geom_bodyid[geom] == 0) continue;
    shapes_.push_back(shapeOf(m, model_.source(), geom));
    geoms_.push_back(static_cast<std::size_t>(geom));
  }
  pose(m->qpos0);
}

int MujocoKinematics::nq() const { return model_.get()->nq; }

std::vector<double> MujocoKinematics::restConfiguration() const {
  return {model_.get()->qpos0, model_.get()->qpos0 + nq()};
}

void MujocoKinematics::pose(const double* qpos) {
  std::copy_n(qpos, nq(), data_->qpos);
  mj_kinematics(model_.get(), data_.get());
}

const double* MujocoKinematics::position(std::size_t index) const {
  return data_->geom_xpos + 3 * geoms_.at(index);
}

const double* MujocoKinematics::rotation(std::size_t index) const {
  return data_->geom_xmat + 9 * geoms_.at(index);
}

const double* MujocoKinematics::bodyPosition(int body) const { return data_->xpos + 3 * body; }

}  // namespace pmeta
