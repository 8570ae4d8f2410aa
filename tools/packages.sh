# Which packages pMeta needs, and installing them.

PACKAGES_BUILD=(g++ make cmake git ca-certificates
  libdnnl-dev libeigen3-dev libhdf5-dev libsodium-dev libtinyxml2-dev libyaml-cpp-dev nlohmann-json3-dev zlib1g-dev libbenchmark-dev libgtest-dev libgmock-dev)
PACKAGES_PYTHON=(python3-matplotlib python3-numpy python3-paramiko python3-yaml python3-pytest)
PACKAGES_MUJOCO=(libmujoco-dev)
PACKAGES_ONNX=(python3-onnx)
PACKAGES_TEST=(chromium iproute2 locales nftables "${PACKAGES_ONNX[@]}" libopencv-dnn-dev)
PACKAGES_LINT_QUICK=(clang-format-14 shellcheck pyflakes3 doxygen)
PACKAGES_LINT=(clang-tidy-14 catkin-lint)
PACKAGES_COVERAGE=(gcovr)
PACKAGES_SCREENSHOT=(xvfb libgl1-mesa-dri imagemagick)
PACKAGES_FILM=(ffmpeg)
PACKAGES_FUZZ_DEBIAN=(clang-14 libclang-rt-14-dev)
PACKAGES_FUZZ_NOETIC=(clang)
PACKAGES_PEERS=(python3-torch libopenblas0-pthread)
PACKAGES_ROS_DEBIAN=(ros-base rosbash rviz catkin
  ros-message-generation ros-message-runtime libroscpp-dev librosconsole-dev
  libstd-msgs-dev ros-std-msgs libsensor-msgs-dev ros-sensor-msgs libgeometry-msgs-dev ros-geometry-msgs
  libvisualization-msgs-dev ros-visualization-msgs libdiagnostic-msgs-dev ros-diagnostic-msgs
  libdiagnostic-updater-dev libtf2-ros-dev libstd-srvs-dev ros-std-srvs
  librviz-dev pluginlib-dev qtbase5-dev
  python3-std-msgs python3-sensor-msgs python3-std-srvs python3-geometry-msgs python3-visualization-msgs python3-diagnostic-msgs python3-tf2-msgs
  python3-rosbag librostest-dev python3-rostest libtopic-tools-dev)
PACKAGES_ROS_NOETIC=(ros-noetic-ros-base ros-noetic-rviz ros-noetic-rosbash ros-noetic-rostest
  ros-noetic-diagnostic-updater ros-noetic-tf2-ros ros-noetic-visualization-msgs ros-noetic-std-srvs ros-noetic-pluginlib
  ros-noetic-topic-tools qtbase5-dev)

use_noetic() { [ -f /opt/ros/noetic/setup.bash ]; }

# a line each; arguments: packages besides those that pMeta needs
wanted_packages() {
  local wanted=("${PACKAGES_BUILD[@]}" "${PACKAGES_PYTHON[@]}" "$@")
  if use_noetic; then
    wanted+=("${PACKAGES_ROS_NOETIC[@]}")
  else
    wanted+=("${PACKAGES_ROS_DEBIAN[@]}")
    [ -n "${MUJOCO_DIR:-}" ] || wanted+=("${PACKAGES_MUJOCO[@]}")
  fi
  printf '%s\n' "${wanted[@]}" | sort -u
}

missing_packages() {
  local wanted
  mapfile -t wanted < <(wanted_packages "$@")
  comm -23 <(printf '%s\n' "${wanted[@]}") <(
    dpkg-query -W -f '${Package} ${db:Status-Status}\n' "${wanted[@]}" 2> /dev/null |
      awk '$2 == "installed" {print $1}' | sort -u)
}

setup() {
  command -v dpkg-query > /dev/null ||
    die "set-up needs Debian 12, or Ubuntu 20.04 with ROS Noetic; on other systems install ROS 1, MuJoCo 2.2, Eigen, HDF5, libsodium, TinyXML-2, yaml-cpp, nlohmann-json and use catkin_make."
  if use_noetic && [ -z "${MUJOCO_DIR:-}" ]; then
    die "Ubuntu has no MuJoCo package: unpack MuJoCo 2.2 and set MUJOCO_DIR to its folder."
  fi
  local missing
  mapfile -t missing < <(missing_packages "$@")
  [ ${#missing[@]} -gt 0 ] || return 0
  echo "installing from $(. /etc/os-release && echo "$PRETTY_NAME"): ${missing[*]}"
  local as_root=()
  if [ "$(id -u)" != 0 ]; then
    command -v sudo > /dev/null || die "installing needs root: run 'apt-get install ${missing[*]}' as root, then this again."
    as_root=(sudo)
  fi
  local log
  log=$(mktemp)
  local options=(-q -o Acquire::Retries=3 -o DPkg::Lock::Timeout=600)
  if ! { "${as_root[@]}" apt-get "${options[@]}" update &&
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "${options[@]}" install -y \
      --no-install-recommends "${missing[@]}"; } > "$log" 2>&1; then
    tail -n 20 "$log" >&2
    die "installing failed; the whole output is in $log."
  fi
  rm -f "$log"
  echo "installed."
}

