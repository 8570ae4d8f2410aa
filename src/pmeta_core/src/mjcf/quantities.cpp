#include "quantities.h"

#include <mujoco/mujoco.h>

#include <algorithm>

namespace pmeta {
namespace {

std::string withoutDots(std::string name) {
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

}  // namespace

std::string positionName(const JointNumber& number) { return withoutDots(number.name); }

std::string velocityName(const JointNumber& number) {
  const bool is_part = number.name.find('.') != std::string::npos;
  return withoutDots(number.name) + (is_part ? "" : "_velocity");
}

std::string sensorUnit(int type) {
  switch (type) {
    case mjSENS_TOUCH:
    case mjSENS_FORCE:
      return "N";
    case mjSENS_TORQUE:
      return "N m";
    case mjSENS_ACCELEROMETER:
    case mjSENS_FRAMELINACC:
      return "m/s^2";
    case mjSENS_VELOCIMETER:
    case mjSENS_FRAMELINVEL:
    case mjSENS_SUBTREELINVEL:
      return "m/s";
    case mjSENS_GYRO:
    case mjSENS_FRAMEANGVEL:
    case mjSENS_BALLANGVEL:
      return "rad/s";
    case mjSENS_FRAMEANGACC:
      return "rad/s^2";
    case mjSENS_RANGEFINDER:
    case mjSENS_FRAMEPOS:
    case mjSENS_SUBTREECOM:
      return "m";
    case mjSENS_CLOCK:
      return "s";
    default:
      return "";
  }
}

}  // namespace pmeta
