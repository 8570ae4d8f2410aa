#pragma once

#include <string>

namespace pmeta {

/// BLAKE2b-256 of the bytes, as 64 hexadecimal digits: equal for equal bytes alone.
std::string hashText(const std::string& bytes);

}  // namespace pmeta
