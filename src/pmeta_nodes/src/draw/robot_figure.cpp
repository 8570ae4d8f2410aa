#include "draw/robot_figure.h"

#include <algorithm>
#include <set>

namespace pmeta_nodes {

using pmeta::GeomShape;
using pmeta::MujocoKinematics;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

namespace {

/// The shade of a part in its policy's colour follows how light the model's material is.
Color shapeColor(const std::vector<GeomShape>& shapes, std::size_t index, const Color& darkest) {
  const auto light = [](const GeomShape& shape) {
    return 0.2126 * shape.rgb[0] + 0.7152 * shape.rgb[1] + 0.0722 * shape.rgb[2];
  };
  double low = light(shapes.front());
  double high = low;
  for (const GeomShape& shape : shapes) {
    low = std::min(low, light(shape));
    high = std::max(high, light(shape));
  }
  const double share = high > low ? (light(shapes[index]) - low) / (high - low) : 0;
  return mix(darkest, rgb(0xffffff), 0.55 * share);
}

/// The quaternion of a rotation matrix (3 x 3, row-major).
geometry_msgs::Quaternion quaternionOf(const double* m) {
  // from the largest of the four components, so that no division is by a small number
  const double trace[4] = {1 + m[0] + m[4] + m[8], 1 + m[0] - m[4] - m[8], 1 - m[0] + m[4] - m[8],
                           1 - m[0] - m[4] + m[8]};
  const auto largest = std::max_element(trace, trace + 4) - trace;
  const double whole = 0.5 * std::sqrt(trace[largest]);
  const double part = 0.25 / whole;
  const double yz = (m[7] - m[5]) * part;
  const double zx = (m[2] - m[6]) * part;
  const double xy = (m[3] - m[1]) * part;
  const double x_y = (m[3] + m[1]) * part;
  const double z_x = (m[2] + m[6]) * part;
  const double y_z = (m[7] + m[5]) * part;
  // w, x, y, z, for each that may be the largest
  const double rows[4][4] = {
      {whole, yz, zx, xy}, {yz, whole, x_y, z_x}, {zx, x_y, whole, y_z}, {xy, z_x, y_z, whole}};
  const double* q = rows[largest];
  geometry_msgs::Quaternion out;
  out.w = q[0];
  out.x = q[1];
  out.y = q[2];
  out.z = q[3];
  return out;
}

geometry_msgs::Point pointOf(double x, double y, double z) {
  geometry_msgs::Point point;
  point.x = x;
  point.y = y;
  point.z = z;
  return point;
}

/// How far a shape reaches above its centre; a bound for cylinders and ellipsoids.
double reachUp(const GeomShape& shape, const double* rotation) {
  const auto& size = shape.size;
  const double axis = std::abs(rotation[8]);
  switch (shape.type) {
    case GeomShape::Type::kCapsule:
    case GeomShape::Type::kCylinder:
      return axis * size[1] + size[0];
    case GeomShape::Type::kBox:
    case GeomShape::Type::kEllipsoid:
      return std::abs(rotation[6]) * size[0] + std::abs(rotation[7]) * size[1] + axis * size[2];
    default:
      return size[0];
  }
}

/// One geom; of a capsule, its cylinder. The model's world moves along below the torso.
Marker drawShape(const MujocoKinematics& kinematics, const RobotPicture& picture,
                 std::size_t index) {
  const std::vector<GeomShape>& shapes = kinematics.shapes();
  const GeomShape& shape = shapes[index];
  Marker marker =
      makeMarker(picture.frame, "geoms",
                 picture.id * static_cast<int>(shapes.size()) + static_cast<int>(index));
  if (!picture.shown) {
    marker.action = Marker::DELETE;
    return marker;
  }
  marker.color = shapeColor(shapes, index, picture.color);
  const double* at = kinematics.position(index);
  const double s = picture.scale;
  marker.pose.position =
      pointOf((at[0] - picture.origin.x) * s, (at[1] - picture.origin.y) * s, at[2] * s);
  marker.pose.orientation = quaternionOf(kinematics.rotation(index));
  const auto resize = [&](int type, double x, double y, double z) {
    marker.type = type;
    marker.scale.x = 2 * x * s;
    marker.scale.y = 2 * y * s;
    marker.scale.z = 2 * z * s;
  };
  const auto& size = shape.size;
  switch (shape.type) {
    case GeomShape::Type::kSphere:
      resize(Marker::SPHERE, size[0], size[0], size[0]);
      break;
    case GeomShape::Type::kEllipsoid:
      resize(Marker::SPHERE, size[0], size[1], size[2]);
      break;
    case GeomShape::Type::kCapsule:
    case GeomShape::Type::kCylinder:
      resize(Marker::CYLINDER, size[0], size[0], size[1]);
      break;
    case GeomShape::Type::kBox:
      resize(Marker::CUBE, size[0], size[1], size[2]);
      break;
  }
  return marker;
}

/// The ends of all capsules that have the radius of shape `first`, in one marker.
Marker drawCaps(const MujocoKinematics& kinematics, const RobotPicture& picture,
                std::size_t first) {
  const std::vector<GeomShape>& shapes = kinematics.shapes();
  const double radius = shapes[first].size[0];
  const double s = picture.scale;
  Marker marker =
      makeMarker(picture.frame, "caps",
                 picture.id * static_cast<int>(shapes.size()) + static_cast<int>(first));
  marker.type = Marker::SPHERE_LIST;
  marker.action = picture.shown ? Marker::ADD : Marker::DELETE;
  marker.scale.x = marker.scale.y = marker.scale.z = 2 * radius * s;
  marker.color = picture.color;
  if (!picture.shown) return marker;
  for (std::size_t i = first; i < shapes.size(); ++i) {
    if (shapes[i].type != GeomShape::Type::kCapsule || shapes[i].size[0] != radius) continue;
    const double* at = kinematics.position(i);
    const double* axes = kinematics.rotation(i);
    for (const double end : {-shapes[i].size[1], shapes[i].size[1]}) {
      marker.points.push_back(pointOf((at[0] - picture.origin.x + end * axes[2]) * s,
                                      (at[1] - picture.origin.y + end * axes[5]) * s,
                                      (at[2] + end * axes[8]) * s));
      marker.colors.push_back(shapeColor(shapes, i, picture.color));
    }
  }
  return marker;
}

}  // namespace

void drawGeoms(const MujocoKinematics& kinematics, const RobotPicture& picture,
               MarkerArray& scene) {
  std::set<double> radii;
  const std::vector<GeomShape>& shapes = kinematics.shapes();
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    scene.markers.push_back(drawShape(kinematics, picture, i));
    if (shapes[i].type == GeomShape::Type::kCapsule && radii.insert(shapes[i].size[0]).second) {
      scene.markers.push_back(drawCaps(kinematics, picture, i));
    }
  }
}

double topOf(const MujocoKinematics& kinematics) {
  double top = 0;
  for (std::size_t i = 0; i < kinematics.shapes().size(); ++i) {
    top = std::max(
        top, kinematics.position(i)[2] + reachUp(kinematics.shapes()[i], kinematics.rotation(i)));
  }
  return top;
}

}  // namespace pmeta_nodes
