#include <algorithm>
#include <cstring>
#include <limits>

#include "checkpoint_format.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta {
namespace {

constexpr std::size_t kMostText = 1 << 20;

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
  if (version != kCheckpointVersion) {
    refuseFile(path, "it is of version " + std::to_string(version) + " of the format, not " +
                         std::to_string(kCheckpointVersion) +
                         ": go on with the pMeta that wrote it, or begin the run anew");
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
