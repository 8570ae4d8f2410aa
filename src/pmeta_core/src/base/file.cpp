#include "pmeta_core/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

/// An open regular file. O_NONBLOCK, since opening a FIFO waits for a writer otherwise.
class RegularFile {
 public:
  RegularFile(const std::string& path, const std::string& what)
      : name_(what + " " + path),
        descriptor_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
    struct stat status {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) refuse(std::strerror(errno));
    if (S_ISDIR(status.st_mode)) refuse("it is a folder");
    if (!S_ISREG(status.st_mode)) refuse("it is not a regular file");
    size_ = static_cast<std::size_t>(status.st_size);
  }
  ~RegularFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  RegularFile(const RegularFile&) = delete;
  RegularFile& operator=(const RegularFile&) = delete;

  std::string read(std::size_t most) const {
    if (size_ > most) {
      fail("it has " + std::to_string(size_) + " bytes, and at most " + std::to_string(most) +
           " are read");
    }
    std::string text;
    text.reserve(size_);
    char buffer[1 << 14];
    for (;;) {
      const ssize_t got = ::read(descriptor_, buffer, sizeof buffer);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) fail(std::strerror(errno));
      if (got == 0) return text;
      text.append(buffer, static_cast<std::size_t>(got));
      if (text.size() > most) fail("it grows while it is read");
    }
  }

 private:
  // in the constructor, after which no destructor runs
  [[noreturn]] void refuse(const std::string& why) {
    if (descriptor_ >= 0) ::close(descriptor_);
    fail(why);
  }

  [[noreturn]] void fail(const std::string& why) const {
    throw Error(name_ + " cannot be read (" + why + ").");
  }

  std::string name_;
  int descriptor_;
  std::size_t size_ = 0;
};

}  // namespace

void requireRegularFile(const std::string& path, const std::string& what) {
  RegularFile(path, what);
}

std::string readFile(const std::string& path, const std::string& what, std::size_t most) {
  return RegularFile(path, what).read(most);
}

}  // namespace pmeta
