#pragma once

#include <cstddef>
#include <string>

#include "pmeta_core/baselines/meta_learner.h"

namespace pmeta {

/// How many transitions each task's replay is to hold: `wanted`, or where that is 0 all of the run,
/// up to the million of PEARL's release. Throws Error, which names the setting
/// "<prefix>buffer_size", if those of all tasks do not fit into memory.
std::size_t replaySize(const MetaTasks& tasks, int wanted, const std::string& prefix);

}  // namespace pmeta
