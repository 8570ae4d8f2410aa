#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace pmeta::fuzz {

/// A file in memory, for parsers that want a path.
class MemoryFile {
 public:
  MemoryFile(const void* data, std::size_t size) : file_(memfd_create("pmeta_fuzz", MFD_CLOEXEC)) {
    if (file_ < 0 || write(file_, data, size) != static_cast<ssize_t>(size)) {
      throw std::runtime_error("a file in memory could not be written");
    }
  }
  explicit MemoryFile(const std::string& text) : MemoryFile(text.data(), text.size()) {}
  ~MemoryFile() { close(file_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

inline std::string textOf(const std::uint8_t* data, std::size_t size) {
  return std::string(reinterpret_cast<const char*>(data), size);
}

/// Cuts off and returns what stands before `separator`; all of it if there is none.
inline std::string cutBefore(std::string& text, const std::string& separator) {
  const std::size_t at = text.find(separator);
  std::string before = text.substr(0, at);
  text.erase(0, at == std::string::npos ? at : at + separator.size());
  return before;
}

inline void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

}  // namespace pmeta::fuzz
