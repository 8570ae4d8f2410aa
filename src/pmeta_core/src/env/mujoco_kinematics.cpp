#include "pmeta_core/env/mujoco_kinematics.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <optional>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

// geoms of MuJoCo that are drawn as themselves
std::optional<GeomShape::Type> typeOf(int type) {
  switch (type) {
    case mjGEOM_SPHERE:
      return GeomShape::Type::kSphere;
    case mjGEOM_CAPSULE:
      return GeomShape::Type::kCapsule;
    case mjGEOM_ELLIPSOID:
      return GeomShape::Type::kEllipsoid;
    case mjGEOM_CYLINDER:
      return GeomShape::Type::kCylinder;
    case mjGEOM_BOX:
      return GeomShape::Type::kBox;
    default:
      return std::nullopt;
  }
}

bool hasShapes(const mjModel* m, int body) {
  for (int i = 0; i < m->body_geomnum[body]; ++i) {
    if (typeOf(m->geom_type[m->body_geomadr[body] + i])) return true;
  }
  return false;
}

// half sides of the box around a mesh, whose vertices are as the geom's frame has them
std::array<double, 3> boxAround(const mjModel* m, int mesh) {
  std::array<double, 3> low{}, high{};
  for (int i = 0; i < m->mesh_vertnum[mesh]; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const double x = m->mesh_vert[3 * (m->mesh_vertadr[mesh] + i) + axis];
      low[axis] = std::min(low[axis], x);
      high[axis] = std::max(high[axis], x);
    }
  }
  return {(high[0] - low[0]) / 2, (high[1] - low[1]) / 2, (high[2] - low[2]) / 2};
}

std::optional<GeomShape> shapeOf(const mjModel* m, int geom) {
  const int body = m->geom_bodyid[geom];
  const auto type = typeOf(m->geom_type[geom]);
  const bool mesh = m->geom_type[geom] == mjGEOM_MESH && !hasShapes(m, body);
  if (body == 0 || !(type || mesh)) return std::nullopt;
  GeomShape shape;
  shape.type = type.value_or(GeomShape::Type::kBox);
  const char* name = mj_id2name(m, mjOBJ_GEOM, geom);
  if (name != nullptr) shape.name = name;
  if (mesh) {
    shape.size = boxAround(m, m->geom_dataid[geom]);
  } else {
    std::copy_n(m->geom_size + 3 * geom, 3, shape.size.begin());
  }
  const int material = m->geom_matid[geom];
  const float* rgba = material < 0 ? m->geom_rgba + 4 * geom : m->mat_rgba + 4 * material;
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
    std::optional<GeomShape> shape = shapeOf(m, geom);
    if (!shape) continue;
    shapes_.push_back(std::move(*shape));
    geoms_.push_back(static_cast<std::size_t>(geom));
  }
  pose(restConfiguration().data());
}

int MujocoKinematics::nq() const { return model_.get()->nq + 3 * model_.get()->nmocap; }

std::vector<double> MujocoKinematics::restConfiguration() const {
  const mjModel* m = model_.get();
  std::vector<double> rest(m->qpos0, m->qpos0 + m->nq);
  rest.resize(static_cast<std::size_t>(nq()));
  for (int body = 0; body < m->nbody; ++body) {
    if (m->body_mocapid[body] < 0) continue;
    std::copy_n(m->body_pos + 3 * body, 3, rest.data() + m->nq + 3 * m->body_mocapid[body]);
  }
  return rest;
}

void MujocoKinematics::pose(const double* configuration) {
  const mjModel* m = model_.get();
  std::copy_n(configuration, m->nq, data_->qpos);
  std::copy_n(configuration + m->nq, 3 * m->nmocap, data_->mocap_pos);
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
