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
class OpenFile {
 public:
  OpenFile(const std::string& path, const std::string& what, bool any_kind = false)
      : name_(what + " " + path),
        descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | (any_kind ? 0 : O_NONBLOCK))) {
    struct stat status {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) refuse(std::strerror(errno));
    if (S_ISDIR(status.st_mode)) refuse("it is a folder");
    if (!any_kind && !S_ISREG(status.st_mode)) refuse("it is not a regular file");
    size_ = static_cast<std::size_t>(status.st_size);
  }
  ~OpenFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

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
      if (text.size() > most) {
        fail("more than " + std::to_string(most) + " bytes come, and at most that is read");
      }
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

void requireRegularFile(const std::string& path, const std::string& what) { OpenFile(path, what); }

std::string readFile(const std::string& path, const std::string& what, std::size_t most) {
  return OpenFile(path, what).read(most);
}

std::string readFileOrPipe(const std::string& path, const std::string& what, std::size_t most) {
  const bool own = path.rfind("/dev/fd/", 0) == 0 || path == "/dev/stdin";
  return OpenFile(path, what, own).read(most);
}

}  // namespace pmeta
