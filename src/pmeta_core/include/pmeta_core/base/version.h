#pragma once

#include <map>
#include <string>

namespace pmeta {

/// The commit this was built from, "-dirty" appended if the tree had changes; "unknown" without
/// git.
std::string commit();

/// Versions of the libraries and compiler in use, by name.
std::map<std::string, std::string> versions();

}  // namespace pmeta
