#include <fcntl.h>
#include <hdf5.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>
#include <mutex>
#include <set>

#include "pmeta_core/base/error.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "checkpoints are little-endian");

constexpr std::size_t kUserBlock = 512;
constexpr char kMagic[] = "pMetaCkp";
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHashBytes = 32;
constexpr std::size_t kMostText = 1 << 20;
constexpr std::uint64_t kOverhead = 1 << 20;  // of HDF5, and to leave some room on the disk

// where the numbers of the user block are
constexpr std::size_t kVersionAt = 8, kLengthAt = 16, kHashAt = 24;
using UserBlock = std::array<unsigned char, kUserBlock>;

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

std::string lastError() { return std::strerror(errno); }

// --- handles ------------------------------------------------------------------------------------

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
hid_t accessWithoutLocks() {
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
#if H5_VERSION_GE(1, 10, 7)
  H5Pset_file_locking(access, false, true);
#endif
  return access;
}

hid_t fileType(StateType type) {
  switch (type) {
    case StateType::kFloat32:
      return H5T_IEEE_F32LE;
    case StateType::kFloat64:
      return H5T_IEEE_F64LE;
    case StateType::kInt64:
      return H5T_STD_I64LE;
    case StateType::kUint64:
      return H5T_STD_U64LE;
    default:
      return H5T_STD_U8LE;
  }
}

// text is one string, which HDF5 wants to be at least one byte long
hid_t textType(std::size_t n) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(n, 1));
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return type;
}

// --- hash ---------------------------------------------------------------------------------------

using Hash = std::array<unsigned char, kHashBytes>;

// of all that follows the user block; false if it cannot be read
bool hashOf(int fd, Hash& hash) {
  if (sodium_init() < 0) return false;
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, kHashBytes);
  std::vector<unsigned char> buffer(1 << 20);
  off_t offset = kUserBlock;
  ssize_t n;
  while ((n = ::pread(fd, buffer.data(), buffer.size(), offset)) > 0) {
    crypto_generichash_update(&state, buffer.data(), static_cast<unsigned long long>(n));
    offset += n;
  }
  crypto_generichash_final(&state, hash.data(), kHashBytes);
  return n == 0;
}

UserBlock userBlockOf(std::uint64_t length, const Hash& hash) {
  UserBlock block{};
  std::memcpy(block.data(), kMagic, kVersionAt);
  std::memcpy(&block[kVersionAt], &kVersion, sizeof kVersion);
  std::memcpy(&block[kLengthAt], &length, sizeof length);
  std::memcpy(&block[kHashAt], hash.data(), kHashBytes);
  return block;
}

// --- writing ------------------------------------------------------------------------------------

/// Adds up what a state takes.
class SizeCounter : public StateWriter {
 public:
  std::uint64_t bytes() const { return bytes_; }

 private:
  void put(const std::string& name, StateType type, const void*, std::size_t n) override {
    if (!names_.insert(name).second) throw std::logic_error(name + " is saved twice");
    bytes_ += n * byteSize(type) + 1024;  // with what HDF5 says about it
  }

  std::set<std::string> names_;
  std::uint64_t bytes_ = 0;
};

class Hdf5Writer : public StateWriter {
 public:
  explicit Hdf5Writer(const std::string& path)
      : path_(path),
        creation_(H5Pcreate(H5P_FILE_CREATE), H5Pclose),
        links_(H5Pcreate(H5P_LINK_CREATE), H5Pclose),
        dataset_(H5Pcreate(H5P_DATASET_CREATE), H5Pclose),
        access_(accessWithoutLocks(), H5Pclose),
        file_((H5Pset_userblock(creation_, kUserBlock),
               H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation_, access_)),
              H5Fclose) {
    if (!file_.good()) fail();
    H5Pset_create_intermediate_group(links_, 1);
    // equal states give equal bytes
    H5Pset_obj_track_times(dataset_, 0);
    H5Pset_fill_time(dataset_, H5D_FILL_TIME_NEVER);
  }

  void close() {
    if (!file_.close()) fail();
  }

 private:
  void put(const std::string& name, StateType type, const void* values, std::size_t n) override {
    const bool text = type == StateType::kText;
    const hsize_t size = n;
    const Handle own(text ? textType(n) : H5Tcopy(fileType(type)), H5Tclose);
    const Handle space(text ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &size, nullptr),
                       H5Sclose);
    Handle data(H5Dcreate2(file_, name.c_str(), own, space, links_, dataset_, H5P_DEFAULT),
                H5Dclose);
    const char nothing = '\0';
    const void* source = text && n == 0 ? &nothing : values;
    const bool empty = !text && n == 0;
    if (!data.good() ||
        (!empty && H5Dwrite(data, own, H5S_ALL, H5S_ALL, H5P_DEFAULT, source) < 0) ||
        !data.close()) {
      fail();
    }
  }

  [[noreturn]] void fail() const {
    throw Error("cannot write the checkpoint " + path_ + " (" + lastError() +
                "): make room, or choose another results_dir.");
  }

  std::string path_;
  Handle creation_, links_, dataset_, access_;
  Handle file_;
};

// gives the file its user block, and has all of it on the disk
void seal(const std::string& path) {
  const Descriptor fd(path, O_RDWR);
  Hash hash;
  const off_t length = ::lseek(fd, 0, SEEK_END);
  bool good = fd >= 0 && length > 0 && hashOf(fd, hash);
  if (good) {
    const UserBlock block = userBlockOf(static_cast<std::uint64_t>(length), hash);
    good = ::pwrite(fd, block.data(), block.size(), 0) == static_cast<ssize_t>(block.size()) &&
           ::fsync(fd) == 0;
  }
  if (!good) throw Error("cannot write the checkpoint " + path + " (" + lastError() + ").");
}

void syncFolder(const std::string& dir) {
  const Descriptor fd(dir, O_RDONLY | O_DIRECTORY);
  if (fd < 0 || ::fsync(fd) != 0) {
    throw Error("cannot write the checkpoint folder " + dir + " (" + lastError() + ").");
  }
}

// HDF5 keeps a file, and its memory, that it could not write to the end: rather find out before
void requireRoom(const std::string& path, std::uint64_t bytes) {
  const Descriptor fd(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (fd >= 0) errno = ::posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  if (fd >= 0 && errno == 0) return;
  throw Error("cannot write the checkpoint " + path + " of " + std::to_string((bytes >> 20) + 1) +
              " MB (" + lastError() + "): make room, or choose another results_dir.");
}

void writeIdentity(StateWriter& writer, const CheckpointIdentity& identity) {
  writer.text("identity/run_id", identity.run_id);
  writer.text("identity/role", identity.task == kAggregator ? "aggregator" : "agent");
  writer.count("identity/task", identity.task);
  writer.count("identity/round", identity.round);
  writer.text("identity/layout", identity.layout);
  std::string settings;
  for (const auto& [key, value] : identity.settings) settings += key + "=" + value + "\n";
  writer.text("identity/settings", settings);
}

struct State {
  const std::function<void(StateWriter&)>& save;
  void saveState(StateWriter& writer) const { save(writer); }
};

}  // namespace

void writeCheckpoint(const std::string& path, const CheckpointIdentity& identity,
                     const std::function<void(StateWriter&)>& save) {
  const std::string dir = std::filesystem::path(path).parent_path().string();
  const std::string temporary = path + ".tmp";
  SizeCounter counter;
  counter.part("state", State{save});
  try {
    requireRoom(temporary, counter.bytes() + kOverhead);
    {
      const Hdf5Lock lock;
      Hdf5Writer writer(temporary);
      writeIdentity(writer, identity);
      writer.part("state", State{save});
      writer.close();
    }
    seal(temporary);
    std::filesystem::rename(temporary, path);
    syncFolder(dir);
  } catch (...) {
    // HDF5 may still have it open: give its room back
    std::error_code ignored;
    std::filesystem::resize_file(temporary, 0, ignored);
    std::filesystem::remove(temporary, ignored);
    throw;
  }
}

// --- reading ------------------------------------------------------------------------------------

namespace {

[[noreturn]] void refuseFile(const std::string& path, const std::string& why) {
  throw Error("the checkpoint " + path + " cannot be used: " + why + ".");
}

// throws Error unless the file is whole and unaltered
void checkFile(const std::string& path) {
  const Descriptor fd(path, O_RDONLY);
  UserBlock block{};
  if (fd < 0) refuseFile(path, lastError());
  const off_t length = ::lseek(fd, 0, SEEK_END);
  const ssize_t n = ::pread(fd, block.data(), block.size(), 0);
  if (n < static_cast<ssize_t>(kVersionAt) || std::memcmp(block.data(), kMagic, kVersionAt) != 0) {
    refuseFile(path, "it is no checkpoint of pMeta");
  }
  std::uint32_t version = 0;
  std::uint64_t claimed = 0;
  std::memcpy(&version, &block[kVersionAt], sizeof version);
  std::memcpy(&claimed, &block[kLengthAt], sizeof claimed);
  if (n < static_cast<ssize_t>(kUserBlock)) refuseFile(path, "it is cut off");
  if (version != kVersion) {
    refuseFile(path, "it is of version " + std::to_string(version) + " of the format, not " +
                         std::to_string(kVersion));
  }
  if (static_cast<std::uint64_t>(length) != claimed) {
    refuseFile(path, "it has " + std::to_string(length) + " bytes of " + std::to_string(claimed) +
                         ", so it is cut off or altered");
  }
  Hash hash;
  if (!hashOf(fd, hash)) refuseFile(path, lastError());
  if (block != userBlockOf(claimed, hash)) refuseFile(path, "it has been altered");
}

}  // namespace

class CheckpointFile::Reader : public StateReader {
 public:
  explicit Reader(const std::string& path)
      : path_(path),
        access_(accessWithoutLocks(), H5Pclose),
        file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access_), H5Fclose) {
    if (!file_.good()) refuseFile(path_, "HDF5 cannot open it");
  }

 private:
  std::size_t sizeOf(const std::string& name, StateType type) const override {
    const Handle data(open(name));
    const Handle space(H5Dget_space(data), H5Sclose);
    const Handle found(H5Dget_type(data), H5Tclose);
    const Handle properties(H5Dget_create_plist(data), H5Pclose);
    bool good =
        H5Pget_layout(properties) == H5D_CONTIGUOUS && H5Pget_external_count(properties) == 0;
    std::size_t n = 0;
    if (type == StateType::kText) {
      n = H5Tget_size(found);
      const Handle expected(textType(n), H5Tclose);
      good =
          good && H5Tequal(found, expected) > 0 && H5Sget_simple_extent_type(space) == H5S_SCALAR;
      if (good && n == 1 && textOf(data, found, 1)[0] == '\0') n = 0;
    } else {
      hsize_t size = 0;
      good = good && H5Tequal(found, fileType(type)) > 0 &&
             H5Sget_simple_extent_ndims(space) == 1 &&
             H5Sget_simple_extent_dims(space, &size, nullptr) == 1;
      n = size;
    }
    if (!good) refuseFile(path_, name + " is no " + pmeta::name(type));
    return n;
  }

  void get(const std::string& name, StateType type, void* values, std::size_t n) const override {
    if (n == 0) return;
    const Handle data(open(name));
    const Handle own(type == StateType::kText ? textType(n) : H5Tcopy(fileType(type)), H5Tclose);
    if (H5Dread(data, own, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) {
      refuseFile(path_, name + " cannot be read");
    }
  }

  Handle open(const std::string& name) const {
    const hid_t id = H5Dopen2(file_, name.c_str(), H5P_DEFAULT);
    if (id < 0) refuseFile(path_, "it has no " + name);
    return {id, H5Dclose};
  }

  std::string textOf(hid_t data, hid_t type, std::size_t n) const {
    std::string text(n, '\0');
    H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data());
    return text;
  }

  std::string path_;
  Handle access_;
  Handle file_;
};

namespace {

CheckpointIdentity readIdentity(const StateReader& reader) {
  CheckpointIdentity identity;
  identity.run_id = reader.text("identity/run_id", kMostText);
  identity.task =
      static_cast<int>(reader.count("identity/task", kAggregator, std::numeric_limits<int>::max()));
  identity.round =
      static_cast<int>(reader.count("identity/round", 0, std::numeric_limits<int>::max()));
  const std::string role = reader.text("identity/role", kMostText);
  if (role != (identity.task == kAggregator ? "aggregator" : "agent")) {
    reader.refuse("identity/role", "is '" + role + "'");
  }
  identity.layout = reader.text("identity/layout", kMostText);
  const std::string settings = reader.text("identity/settings", kMostText);
  for (std::size_t begin = 0; begin < settings.size();) {
    const std::size_t end = std::min(settings.find('\n', begin), settings.size());
    const std::string line = settings.substr(begin, end - begin);
    const std::size_t split = std::min(line.find('='), line.size());
    identity.settings[line.substr(0, split)] = line.substr(std::min(split + 1, line.size()));
    begin = end + 1;
  }
  return identity;
}

struct Loader {
  const std::function<void(StateReader&)>& load;
  void loadState(StateReader& reader) { load(reader); }
};

std::string partyName(int task) {
  return task == kAggregator ? "the aggregator" : "task " + std::to_string(task);
}

}  // namespace

CheckpointFile::CheckpointFile(const std::string& path) : path_(path) {
  checkFile(path);
  const Hdf5Lock lock;
  reader_ = std::make_unique<Reader>(path);
  identity_ = readIdentity(*reader_);
}

CheckpointFile::~CheckpointFile() {
  const Hdf5Lock lock;
  reader_.reset();
}

void CheckpointFile::require(const CheckpointIdentity& expected) const {
  const CheckpointIdentity& found = identity_;
  if (found.task != expected.task) {
    refuseFile(path_, "it is of " + partyName(found.task) + ", not of " + partyName(expected.task));
  }
  const std::string key = firstDifference(found.settings, expected.settings);
  if (!key.empty()) {
    const auto shown = [&](const CheckpointIdentity& identity) {
      const auto value = identity.settings.find(key);
      return value == identity.settings.end() ? std::string("not set") : value->second;
    };
    refuseFile(path_, "it is of another experiment, with " + key + " " + shown(found) +
                          " where this run has " + shown(expected));
  }
  if (found.run_id != expected.run_id) {
    refuseFile(path_, "it is of run '" + found.run_id + "', not of '" + expected.run_id + "'");
  }
  if (found.layout != expected.layout) {
    refuseFile(path_, "its model has another layout than this run's");
  }
}

void CheckpointFile::load(const std::function<void(StateReader&)>& load) {
  const Hdf5Lock lock;
  Loader loader{load};
  reader_->part("state", loader);
}

}  // namespace pmeta
