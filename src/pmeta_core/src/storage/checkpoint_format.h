#pragma once

#include <fcntl.h>
#include <hdf5.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <mutex>
#include <string>

#include "pmeta_core/base/state.h"

namespace pmeta {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "checkpoints are little-endian");

constexpr std::size_t kUserBlock = 512;
constexpr char kMagic[] = "pMetaCkp";
constexpr std::uint32_t kCheckpointVersion = 2;
constexpr std::size_t kHashBytes = 32;

// where the numbers of the user block are
constexpr std::size_t kVersionAt = 8, kLengthAt = 16, kHashAt = 24;
using UserBlock = std::array<unsigned char, kUserBlock>;

using Hash = std::array<unsigned char, kHashBytes>;

/// The right to call HDF5, which need not have been built for more than one thread.
class Hdf5Lock {
 public:
  Hdf5Lock() : lock_(mutex()) {
    // at exit it would trip over a file that it could not close, as where the disk was full
    static const herr_t kNoCleanUp = H5dont_atexit();
    static_cast<void>(kNoCleanUp);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> lock_;
};

/// What errno says, in words.
std::string lastError();

/// A file descriptor, closed at the end of the scope.
class Descriptor {
 public:
  Descriptor(const std::string& path, int flags)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  operator int() const { return fd_; }

 private:
  int fd_;
};

/// An object of HDF5, closed at the end of the scope.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() { close(); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  bool good() const { return id_ >= 0; }
  operator hid_t() const { return id_; }

  /// False if it cannot be closed, e.g. because the disk is full.
  bool close() {
    const bool done = id_ < 0 || close_(id_) >= 0;
    id_ = -1;
    return done;
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// A file is written under a name of its own and then renamed, and is whole when it is read: it
// needs no lock, which some file systems do not have. HDF5 before 1.10.7 takes none only where
// HDF5_USE_FILE_LOCKING=FALSE is in the environment.
hid_t accessWithoutLocks();

hid_t fileType(StateType type);

// text is one string, which HDF5 wants to be at least one byte long
hid_t textType(std::size_t n);

// of all that follows the user block; false if it cannot be read
bool hashOf(int fd, Hash& hash);

UserBlock userBlockOf(std::uint64_t length, const Hash& hash);

}  // namespace pmeta
