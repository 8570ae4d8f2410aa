#include "pmeta_core/base/version.h"

#include <hdf5.h>
#include <mujoco/mujoco.h>
#include <sodium.h>
#include <zlib.h>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "pmeta_core/base/build.h"

namespace pmeta {

std::map<std::string, std::string> versions() {
  const auto dotted = [](int a, int b, int c) {
    return std::to_string(a) + "." + std::to_string(b) + "." + std::to_string(c);
  };
  return {
      {"pmeta", kVersion},
      {"compiler", __VERSION__},
      {"eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
      {"hdf5", dotted(H5_VERS_MAJOR, H5_VERS_MINOR, H5_VERS_RELEASE)},
      {"libsodium", sodium_version_string()},
      {"mujoco", mj_versionString()},
      {"nlohmann_json", dotted(NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                               NLOHMANN_JSON_VERSION_PATCH)},
      {"zlib", zlibVersion()},
  };
}

}  // namespace pmeta
