#include "pmeta_core/security/key_file.h"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr std::size_t kDigits = 2 * sizeof(Key);

class File {
 public:
  File(const std::string& path, int flags, mode_t mode = 0)
      : descriptor_(open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, mode)) {}
  ~File() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  bool isOpen() const { return descriptor_ >= 0; }
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

std::string octal(mode_t mode) {
  char text[16];
  std::snprintf(text, sizeof text, "%04o", static_cast<unsigned>(mode & 07777));
  return text;
}

void requirePrivate(const File& file, const std::string& path) {
  struct stat status {};
  if (fstat(file.descriptor(), &status) != 0) {
    throw Error("the key file " + path + " cannot be read (" + std::strerror(errno) + ").");
  }
  if (!S_ISREG(status.st_mode)) {
    throw Error("the key file " + path + " is not a regular file: make one with ./pmeta key FILE.");
  }
  if (status.st_uid != geteuid()) {
    throw Error("the key file " + path + " belongs to another user: use a copy of your own.");
  }
  if ((status.st_mode & 07777 & ~mode_t{0600}) != 0) {
    throw Error("the key file " + path + " has mode " + octal(status.st_mode) +
                ", which lets others at it: run chmod 600 " + path + ".");
  }
}

}  // namespace

Key readKeyFile(const std::string& path) {
  // a pipe of that name must not hold us up
  const File file(path, O_RDONLY | O_NONBLOCK);
  if (!file.isOpen()) {
    throw Error("the key file " + path + " cannot be opened (" +
                (errno == ELOOP ? "it is a symbolic link" : std::strerror(errno)) +
                "): make one with ./pmeta key FILE.");
  }
  requirePrivate(file, path);
  char text[kDigits + 2];
  const ssize_t size = read(file.descriptor(), text, sizeof text);
  Key key{};
  std::size_t bytes = 0;
  const auto read_all = static_cast<std::size_t>(size < 0 ? 0 : size);
  const bool ends_there = read_all == kDigits || (read_all == kDigits + 1 && text[kDigits] == '\n');
  const bool good = ends_there && sodium_hex2bin(key.data(), key.size(), text, kDigits, nullptr,
                                                 &bytes, nullptr) == 0;
  sodium_memzero(text, sizeof text);
  if (!good || bytes != key.size()) {
    throw Error("the key file " + path + " does not hold " + std::to_string(kDigits) +
                " hexadecimal digits and nothing else: make one with ./pmeta key FILE.");
  }
  return key;
}

void createKeyFile(const std::string& path) {
  if (sodium_init() < 0) throw Error("libsodium cannot be used on this machine: no key was made.");
  const File file(path, O_WRONLY | O_CREAT | O_EXCL, 0600);
  if (!file.isOpen()) {
    if (errno == EEXIST) {
      throw Error(path + " is there already and was left as it is: give a new name.");
    }
    throw Error("the key file " + path + " cannot be created (" + std::strerror(errno) + ").");
  }
  Key key{};
  randombytes_buf(key.data(), key.size());
  char text[kDigits + 1];
  sodium_bin2hex(text, sizeof text, key.data(), key.size());
  text[kDigits] = '\n';
  const bool written = write(file.descriptor(), text, sizeof text) == ssize_t{sizeof text} &&
                       fsync(file.descriptor()) == 0;
  const std::string why = std::strerror(errno);
  sodium_memzero(text, sizeof text);
  sodium_memzero(key.data(), key.size());
  if (written) return;
  unlink(path.c_str());
  throw Error("the key file " + path + " cannot be written (" + why + ").");
}

}  // namespace pmeta
