# Finds MuJoCo as the folder MUJOCO_DIR (the official archive: include/, lib/) or as an installed package.
# Defines the target MuJoCo::MuJoCo.
set(MUJOCO_DIR "" CACHE PATH "Folder of a MuJoCo 2.2 archive; empty: use the installed package")

find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h
  HINTS ${MUJOCO_DIR}/include NO_DEFAULT_PATH)
find_library(MuJoCo_LIBRARY NAMES mujoco HINTS ${MUJOCO_DIR}/lib NO_DEFAULT_PATH)
if(NOT MUJOCO_DIR)
  find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h)
  find_library(MuJoCo_LIBRARY NAMES mujoco)
endif()

if(MuJoCo_INCLUDE_DIR)
  file(STRINGS ${MuJoCo_INCLUDE_DIR}/mujoco/mujoco.h _version_line REGEX "#define mjVERSION_HEADER")
  string(REGEX MATCH "[0-9]+" _version_number "${_version_line}")
  if(_version_number)
    math(EXPR _major "${_version_number} / 100")
    math(EXPR _minor "${_version_number} / 10 % 10")
    math(EXPR _patch "${_version_number} % 10")
    set(MuJoCo_VERSION ${_major}.${_minor}.${_patch})
  endif()
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(MuJoCo
  REQUIRED_VARS MuJoCo_LIBRARY MuJoCo_INCLUDE_DIR
  VERSION_VAR MuJoCo_VERSION)

if(MuJoCo_FOUND AND NOT TARGET MuJoCo::MuJoCo)
  add_library(MuJoCo::MuJoCo SHARED IMPORTED)
  set_target_properties(MuJoCo::MuJoCo PROPERTIES
    IMPORTED_LOCATION ${MuJoCo_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${MuJoCo_INCLUDE_DIR})
endif()
