#pragma once

#include <map>
#include <string>

namespace pmeta {

/// What the numbers of a run depend on besides its settings and the versions of libraries, for its
/// manifest: the processor's model, the product of matrices and its instruction set, the other
/// kernels, and the C library, whose functions choose theirs by the processor too.
std::map<std::string, std::string> machine();

}  // namespace pmeta
