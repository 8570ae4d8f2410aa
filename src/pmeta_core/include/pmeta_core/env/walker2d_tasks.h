#pragma once

#include <string>
#include <vector>

#include "pmeta_core/env/walker2d.h"

namespace pmeta {

/// Reads the tasks of a walker2d_params_tasks.csv: columns task, field (body_mass, body_inertia,
/// dof_damping, geom_friction), row, col, multiplier, value. Every task lists every figure of the
/// model once, in the order of Walker2dTask. Throws Error naming the line and column otherwise, and
/// where `value` is not the base model's figure times the multiplier.
std::vector<Walker2dTask> readWalker2dTasks(const std::string& path, const MujocoModel& base);

}  // namespace pmeta
