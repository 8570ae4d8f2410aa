#pragma once

#include <string>

#include "pmeta_core/base/error.h"

namespace pmeta {

/// Somebody else writes the folder.
class FolderInUse : public Error {
 public:
  using Error::Error;
};

/// The right to write a run folder: one process, and one RunLock of it, has it at a time.
///
/// It is a lock of the kernel on the file `lock` in the folder, which also says who has it, so
/// that nothing is left of it once its process has died, however that came. Where the file system
/// cannot lock, the file alone counts: whom it names has the folder as long as that process lives.
class RunLock {
 public:
  /// Takes the folder, which must be there. Throws FolderInUse, which names who else has it, or
  /// Error.
  explicit RunLock(const std::string& run_dir);
  ~RunLock();
  RunLock(RunLock&& other) noexcept;           ///< the right goes to the new one
  RunLock& operator=(RunLock other) noexcept;  ///< lets its own folder go and takes the other's

  /// Lets the folder go before the end of the scope.
  void release() noexcept;

  const std::string& path() const { return path_; }  ///< of the file

  /// Who writes that folder now, e.g. "process 4711 on host robot2"; "" if nobody does.
  static std::string holder(const std::string& run_dir);

 private:
  std::string path_;
  int fd_ = -1;
};

/// The name of this machine.
std::string hostName();

}  // namespace pmeta
