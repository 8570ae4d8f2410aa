#pragma once

#include <cstddef>
#include <string>

namespace pmeta {

/// Largest text file that is read whole where nothing else is said: 256 MiB.
constexpr std::size_t kLargestFile = std::size_t{1} << 28;

/// Throws Error unless `path` can be opened and is a regular file: a FIFO of that name, which would
/// hold up whoever opens it, or a device is refused in a sentence. `what` names it in errors, e.g.
/// "the policy file".
void requireRegularFile(const std::string& path, const std::string& what);

/// Reads a whole regular file of at most `most` bytes. Throws Error, also on a FIFO or a device.
std::string readFile(const std::string& path, const std::string& what,
                     std::size_t most = kLargestFile);

/// The same, but for the process's own descriptors (/dev/fd/N, /dev/stdin), which may be of any
/// kind: a shell gives such a name to a command's output, `<(command)`.
std::string readFileOrPipe(const std::string& path, const std::string& what,
                           std::size_t most = kLargestFile);

}  // namespace pmeta
