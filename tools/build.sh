# Building, and whether it is needed.

source_setup() {
  local file=$1
  [ -f "$file" ] || die "$file is missing: run ./pmeta build first."
  set +u
  # shellcheck disable=SC1090
  . "$file"
  set -u
}

# percentages as they pass; the whole output is in the log
show_progress() {
  local last=-10 percent
  while IFS= read -r line; do
    [[ $line =~ ^\[\ *([0-9]+)%\]\ (Building|Generating) ]] || continue
    percent=${BASH_REMATCH[1]}
    if [ -t 1 ]; then
      printf '\rbuilding %3d %%' "$percent"
    elif [ $((percent - last)) -ge 20 ]; then
      echo "building $percent %"
      last=$percent
    fi
  done
  [ ! -t 1 ] || printf '\r\033[K'
}

# Builds the given targets, or all, into the folder BUILD.
BUILD=build
BUILD_OPTIONS=(-DCMAKE_BUILD_TYPE=Release)

build() {
  setup
  mkdir -p "$TOP/$BUILD"
  local log=$TOP/$BUILD/build.log jobs=${JOBS:-$(nproc)} targets=("$@")
  local options=("${BUILD_OPTIONS[@]}") folders=()
  [ "$BUILD" = build ] ||
    folders=(--build "$BUILD" "-DCATKIN_DEVEL_PREFIX=$TOP/$BUILD/devel")
  [ -z "${MUJOCO_DIR:-}" ] || options+=("-DMUJOCO_DIR=$MUJOCO_DIR")
  [ -z "${PMETA_BENCHMARKS:-}" ] || options+=("-DPMETA_BENCHMARKS=ON")
  if ! (
    cd "$TOP"
    if use_noetic; then source_setup /opt/ros/noetic/setup.bash; fi
    # once configured, make alone sees what has changed, and is much quicker about it
    if [ -f "$BUILD/Makefile" ] && [ "${options[*]}" = "$(cat "$BUILD/options" 2> /dev/null)" ]; then
      make -C "$BUILD" -j"$jobs" "${targets[@]}" 2>&1 | tee "$log" | show_progress
    else
      catkin_make "${folders[@]}" -j"$jobs" "${options[@]}" "${targets[@]}" 2>&1 |
        tee "$log" | show_progress
    fi
    [ "${PIPESTATUS[0]}" = 0 ] || exit 1
    echo "${options[*]}" > "$BUILD/options"
  ); then
    grep -nE -m 5 'error|Error' "$log" >&2 || true
    tail -n 30 "$log" >&2
    die "the build failed; the whole output is in $log."
  fi
}

ensure_built() {
  build
  source_setup "$TOP/devel/setup.bash"
  # nodes talk on this machine only, unless the user says otherwise
  [ -n "${ROS_IP:-}${ROS_HOSTNAME:-}" ] || export ROS_IP=127.0.0.1
  export ROSCONSOLE_STDOUT_LINE_BUFFERED=1
}

