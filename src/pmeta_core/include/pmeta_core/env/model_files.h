#pragma once

#include <string>
#include <vector>

namespace pmeta {

/// The files that a MuJoCo model is read from: its MJCF or URDF, and all that it names (included
/// files, meshes, textures, height fields, skins).
struct ModelFiles {
  std::string folder;              ///< below which all of them are
  std::vector<std::string> names;  ///< in it; the MJCF comes first
  std::string hash;                ///< of their names and bytes; of one alone, that of its bytes

  /// Throws Error if a file cannot be read, or is named with its full path.
  static ModelFiles find(const std::string& mjcf);

  /// Copies them below `dir`, where they name each other as before. Throws Error, also if they have
  /// changed since they were found.
  void copyTo(const std::string& dir) const;
};

}  // namespace pmeta
