#include <cerrno>
#include <filesystem>
#include <functional>
#include <set>

#include "checkpoint_format.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta {
namespace {

constexpr std::uint64_t kOverhead = 1 << 20;  // of HDF5, and to leave some room on the disk

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

}  // namespace pmeta
