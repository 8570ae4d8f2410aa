#pragma once

#include <functional>
#include <string>

#include "pmeta_core/base/registry.h"

namespace pmeta {

/// Loads a shared library for good, whose rows are then in their registries; nothing if it is
/// loaded already. Throws Error if it is none, needs what is not there, was compiled in a way that
/// does not fit (see misfit()), or has a row of a name that is taken.
void loadLibrary(const std::string& path);

/// Gives the path of the library that is to have the row of that name, "my_package/MyFamily".
/// Throws Error, which names those that there are, if it knows of none.
using LibraryFinder = std::function<std::string(const std::string& name)>;

/// What finds libraries of packages: ROS's is a row of libpmeta_packages.so, which is loaded when
/// it is first needed.
Registry<LibraryFinder>& libraryFinders();

/// Loads the library of the package that `name`, "my_package/MyFamily", begins with. Throws Error
/// if nothing finds it, and as loadLibrary() does.
void loadPackage(const std::string& name);

}  // namespace pmeta
