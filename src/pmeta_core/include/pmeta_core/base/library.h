#pragma once

#include <string>

namespace pmeta {

/// Loads a shared library for good, whose rows are then in their registries; nothing if it is
/// loaded already. Throws Error if it is none, or needs what is not there.
void loadLibrary(const std::string& path);

}  // namespace pmeta
