#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/mujoco_model.h"

struct mjData_;

namespace pmeta {

/// What one geom of a body looks like.
struct GeomShape {
  /// What stands for a geom in drawings, and what its size means.
  enum class Type {
    kSphere,     ///< size: radius
    kCapsule,    ///< size: radius, half length of the cylinder, along z
    kEllipsoid,  ///< size: half axes
    kCylinder,   ///< size: radius, half length, along z
    kBox,        ///< size: half sides; also of a mesh, as far as it reaches from its middle
  };
  Type type = Type::kSphere;     ///< tells how to read `size`
  std::string name;              ///< "" if it has none
  std::array<double, 3> size{};  ///< m
  std::array<double, 3> rgb{};   ///< of its material, or its own; 0 to 1
};

/// Where the geoms of a model's bodies are in a given configuration: forward kinematics, no
/// dynamics. For drawings.
class MujocoKinematics {
 public:
  /// Keeps a copy of `model`. Left out are geoms of the world, such as the floor, planes and height
  /// fields, and meshes of bodies that have other geoms, which stand for them in collisions.
  explicit MujocoKinematics(const MujocoModel& model);

  /// In the order of the model's geoms.
  const std::vector<GeomShape>& shapes() const { return shapes_; }
  /// Numbers in a configuration: the model's nq, then three for the position of each mocap body.
  int nq() const;

  /// The configuration that the model rests in, nq().
  std::vector<double> restConfiguration() const;

  /// Takes up a configuration of nq() numbers; quaternions need not be normalised.
  void pose(const double* configuration);

  /// Centre (m) of shape `index` and its orientation (3 x 3, row-major), world axes, in the last
  /// pose().
  const double* position(std::size_t index) const;
  const double* rotation(std::size_t index) const;  ///< see position()

  /// Origin (m) of a body's frame, world axes, in the last pose(); see MujocoModel::body().
  const double* bodyPosition(int body) const;

 private:
  struct Delete {
    void operator()(mjData_* data) const;
  };
  MujocoModel model_;
  std::unique_ptr<mjData_, Delete> data_;
  std::vector<GeomShape> shapes_;
  std::vector<std::size_t> geoms_;  // of each shape, its index in the model
};

}  // namespace pmeta
