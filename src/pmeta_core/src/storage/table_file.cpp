#include "pmeta_core/storage/table_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "pmeta_core/base/error.h"

namespace pmeta {

TableFile::TableFile(std::string path) : path_(std::move(path)) { open(); }

void TableFile::open() {
  file_.open(path_, std::ios::app);
  std::error_code error;
  size_ = before_ = std::filesystem::file_size(path_, error);
  if (!file_ || error) throw Error("cannot write " + path_ + ": is the disk full?");
}

void TableFile::append(const std::string& lines) {
  if (!file_.is_open()) open();
  file_ << lines << std::flush;
  if (!file_) {
    const std::string why = std::strerror(errno);
    cut(size_);
    throw Error("cannot write " + path_ + " (" + why + "): is the disk full?");
  }
  before_ = size_;
  size_ += lines.size();
}

void TableFile::takeBack() { cut(before_); }

void TableFile::cut(std::uintmax_t size) {
  file_.close();
  file_.clear();
  std::error_code ignored;
  std::filesystem::resize_file(path_, size, ignored);
}

void TableFile::sync() const {
  const int file = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);
  const bool synced = file >= 0 && ::fsync(file) == 0;
  const std::string why = std::strerror(errno);
  if (file >= 0) ::close(file);
  if (!synced) throw Error("cannot write " + path_ + " (" + why + ").");
}

}  // namespace pmeta
