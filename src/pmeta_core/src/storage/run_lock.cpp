#include "pmeta_core/storage/run_lock.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <utility>

#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kLock[] = "/lock";
constexpr char kWithoutLocks[] = "/lock.process";  // where the file system cannot lock

// when a process began, in ticks since the system did: a number may come again, not with this. 0 if
// it is not known
long long startOf(long long pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  // the second of its fields, a name in brackets, may hold blanks and brackets
  const auto name = text.rfind(')');
  if (name == std::string::npos) return 0;
  std::istringstream fields(text.substr(name + 1));
  std::string field;
  for (int i = 3; i <= 22; ++i) fields >> field;
  return fields ? std::atoll(field.c_str()) : 0;
}

struct Holder {
  long long pid = 0;
  long long start = 0;
  std::string host;

  bool known() const { return pid > 0 && isPlainText(host); }
  std::string text() const {
    return known() ? "process " + std::to_string(pid) + " on host " + host : "another process";
  }
  // of a process of another host nobody here can know
  bool alive() const {
    if (!known() || host != hostName()) return true;
    if (::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH) return false;
    return start == 0 || startOf(pid) == start;
  }
};

Holder readHolder(int fd) {
  std::array<char, 1024> text{};
  const ssize_t n = ::pread(fd, text.data(), text.size(), 0);
  const Json json = Json::parse(text.data(), text.data() + std::max<ssize_t>(n, 0), nullptr, false);
  Holder holder;
  if (!json.is_object()) return holder;
  const auto number = [&](const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_number_integer() ? found->get<long long>() : 0;
  };
  holder.pid = number("pid");
  holder.start = number("start");
  if (json.contains("host") && json["host"].is_string()) holder.host = json["host"];
  return holder;
}

bool writeHolder(int fd) {
  const std::string text =
      Json{{"pid", ::getpid()}, {"start", startOf(::getpid())}, {"host", hostName()}}.dump() + "\n";
  return ::ftruncate(fd, 0) == 0 &&
         ::pwrite(fd, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
}

// a lock of the open file, not of the process: a second one within a process is refused too
struct flock wholeFile() {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  return lock;
}

bool cannotLock(int error) { return error == ENOLCK || error == EOPNOTSUPP || error == EINVAL; }

// is the open file still the one of that name? Whoever lets go of a folder removes it
bool isStill(int fd, const std::string& path) {
  struct stat open {};
  struct stat named {};
  return ::fstat(fd, &open) == 0 && ::stat(path.c_str(), &named) == 0 &&
         open.st_dev == named.st_dev && open.st_ino == named.st_ino;
}

/// An open file that is closed at the end of the scope, unless it is kept.
struct File {
  int fd;
  ~File() {
    if (fd >= 0) ::close(fd);
  }
  int keep() {
    const int kept = fd;
    fd = -1;
    return kept;
  }
};

[[noreturn]] void refuse(const std::string& run_dir, const Holder& holder) {
  throw FolderInUse("the run folder " + run_dir + " is being written by " + holder.text() +
                    ": wait until that has ended, or stop it.");
}

// whom the file names that counts where locks do not; nothing if there is none, or if that process
// has died
std::optional<Holder> livingHolder(const std::string& run_dir) {
  const File file{::open((run_dir + kWithoutLocks).c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0) return std::nullopt;
  const Holder holder = readHolder(file.fd);
  return holder.alive() ? std::optional<Holder>(holder) : std::nullopt;
}

[[noreturn]] void refuseWithoutLocks(const std::string& run_dir, const std::string& who,
                                     const std::string& path) {
  throw FolderInUse("the run folder " + run_dir + " is being written by " + who +
                    ", and its file system cannot lock files: if that process is gone, remove " +
                    path + ".");
}

// Removes what a process that has died left behind. One at a time: of two that read the same file,
// the slower one would remove that of the quicker one, which has the folder by then. False if the
// system cannot, see errno.
bool clearAway(const std::string& run_dir) {
  const std::string path = run_dir + kWithoutLocks;
  const std::string clearing = path + ".clearing";
  const File turn{::open(clearing.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)};
  if (turn.fd < 0) {
    if (errno != EEXIST) return false;
    refuseWithoutLocks(run_dir, "another process", clearing);
  }
  const auto holder = livingHolder(run_dir);
  if (!holder) ::unlink(path.c_str());
  ::unlink(clearing.c_str());
  if (holder) refuseWithoutLocks(run_dir, holder->text(), path);
  return true;
}

// only one can make a file that is not there
int takeWithoutLocks(const std::string& run_dir) {
  const std::string path = run_dir + kWithoutLocks;
  while (true) {
    const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST || !clearAway(run_dir)) return fd;
  }
}

}  // namespace

RunLock::RunLock(const std::string& run_dir) : path_(run_dir + kLock) {
  while (fd_ < 0) {
    File file{::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)};
    struct flock lock = wholeFile();
    if (file.fd >= 0 && ::fcntl(file.fd, F_OFD_SETLK, &lock) == 0) {
      if (!isStill(file.fd, path_)) continue;
      if (const auto other = livingHolder(run_dir)) {
        ::unlink(path_.c_str());
        refuse(run_dir, *other);  // to whom the file system cannot lock
      }
      fd_ = file.keep();
      continue;
    }
    const int error = errno;
    if (file.fd >= 0 && (error == EAGAIN || error == EACCES)) {
      refuse(run_dir, readHolder(file.fd));
    }
    if (file.fd >= 0 && cannotLock(error)) {
      ::unlink(path_.c_str());
      path_ = run_dir + kWithoutLocks;
      fd_ = takeWithoutLocks(run_dir);
    }
    if (fd_ < 0) {
      throw Error("the run folder " + run_dir + " cannot be locked (" + std::strerror(error) +
                  "): choose another with results_dir:=DIR.");
    }
  }
  if (!writeHolder(fd_)) {
    const std::string why = std::strerror(errno);
    ::unlink(path_.c_str());
    ::close(fd_);
    throw Error("cannot write " + path_ + " (" + why + "): is the disk full?");
  }
}

RunLock::RunLock(RunLock&& other) noexcept : path_(std::move(other.path_)), fd_(other.fd_) {
  other.fd_ = -1;
}

RunLock& RunLock::operator=(RunLock other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  return *this;
}

RunLock::~RunLock() { release(); }

void RunLock::release() noexcept {
  if (fd_ < 0) return;
  ::unlink(path_.c_str());
  ::close(fd_);
  fd_ = -1;
}

std::string RunLock::holder(const std::string& run_dir) {
  const File locked{::open((run_dir + kLock).c_str(), O_RDONLY | O_CLOEXEC)};
  struct flock lock = wholeFile();
  if (locked.fd >= 0 && ::fcntl(locked.fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK) {
    return readHolder(locked.fd).text();
  }
  const auto holder = livingHolder(run_dir);
  return holder ? holder->text() : "";
}

std::string hostName() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "unknown";
  return name.data();
}

}  // namespace pmeta
