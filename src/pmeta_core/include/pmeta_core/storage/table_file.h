#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace pmeta {

/// A CSV file of a run that grows, never by half of what is appended.
class TableFile {
 public:
  /// `path` is there already, with its header. Throws Error.
  explicit TableFile(std::string path);

  /// Appends whole lines and flushes them. Throws Error, e.g. if the disk is full; the file is then
  /// as it was, and the same can be tried again.
  void append(const std::string& lines);

  /// The file is again as it was before the last append().
  void takeBack();

  /// Waits until what has been appended is on the disk. Throws Error.
  void sync() const;

 private:
  void open();
  void cut(std::uintmax_t size);

  std::string path_;
  std::ofstream file_;
  std::uintmax_t size_ = 0;    // of what is whole
  std::uintmax_t before_ = 0;  // the same before the last append()
};

}  // namespace pmeta
