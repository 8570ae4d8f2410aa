#pragma once

#include <string>

#include "pmeta_core/mjcf/elements.h"

namespace pmeta {

/// What the number of a joint's position is called in an observation.
std::string positionName(const JointNumber& number);
/// The same of its velocity.
std::string velocityName(const JointNumber& number);

/// The unit of what a sensor of that type of MuJoCo measures; "" where it has none, or several.
std::string sensorUnit(int type);

}  // namespace pmeta
