#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace pmeta {

/// The secret that all parties of a run share.
using Key = std::array<std::uint8_t, 32>;

/// Reads a key of 64 hexadecimal digits. Throws Error unless `path` is a regular file (no link) of
/// this user's that nobody else may read or write (mode 0600 or stricter). No error shows the key.
Key readKeyFile(const std::string& path);

/// Writes a new key, drawn from the operating system's generator, to a file of mode 0600. Throws
/// Error if the file is there already or cannot be written.
void createKeyFile(const std::string& path);

}  // namespace pmeta
