# Building, and whether it is needed.

# arguments: a workspace's setup.bash, and what it is given
source_setup() {
  local file=$1
  [ -f "$file" ] || die "$file is missing: run ./pmeta build first."
  set +u
  # shellcheck disable=SC1090
  . "$file" "${@:2}"
  set -u
}

# The caller's own workspaces, which may have environments for pMeta, but for those with a pMeta of
# their own; those that are looked into first come first in OVERLAYS.
source_overlays() {
  local prefixes at prefix
  IFS=: read -ra prefixes <<< "$OVERLAYS"
  for ((at = ${#prefixes[@]} - 1; at >= 0; at--)); do
    prefix=${prefixes[at]}
    if [ -f "$prefix/.catkin" ] && [[ $prefix != /opt/ros/* && ! -d $prefix/share/pmeta_core ]]; then
      source_setup "$prefix/setup.bash" --extend
    fi
  done
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

BUILD=build
BUILD_OPTIONS=(-DCMAKE_BUILD_TYPE=Release)

build_options() {
  printf '%s\n' -DCMAKE_EXPORT_COMPILE_COMMANDS=ON "${BUILD_OPTIONS[@]}" ${MUJOCO_DIR:+"-DMUJOCO_DIR=$MUJOCO_DIR"}
  # once asked for, benchmarks are built with the rest: leaving them out again would configure anew
  if [ -n "${PMETA_BENCHMARKS:-}" ] || grep -qs PMETA_BENCHMARKS "$TOP/$BUILD/options"; then
    echo -DPMETA_BENCHMARKS=ON
  fi
}

# What a build depends on, a line each: how it is configured, the commit, which packages are
# installed, sources.
inputs() (
  cd "$TOP" || exit
  build_options
  git describe --always --dirty --exclude '*' 2> /dev/null || true
  stat -c '%n %Y' /var/lib/dpkg/status 2> /dev/null || true
  find src config/models test -type f ! -name '*.py' ! -name '*.pyc' -printf '%p %s %T@\n' |
    LC_ALL=C sort
)

# what came of it
products() (
  cd "$TOP" || exit
  { find devel -type f -printf '%p %s %T@\n' 2> /dev/null || true; } | LC_ALL=C sort
)

is_built() {
  [ -f "$TOP/build/inputs" ] && [ "$(inputs)" = "$(cat "$TOP/build/inputs")" ] &&
    [ "$(products)" = "$(cat "$TOP/build/products")" ]
}

# make sees what is newer than the last build: a file that was put back as it was before is older
touch_what_changed() {
  local file
  [ -f "$TOP/build/inputs" ] || return 0
  inputs | grep -vxFf "$TOP/build/inputs" |
    sed -n 's/^\(\(src\|config\|test\)\/.*\) [0-9]* [0-9.]*$/\1/p' |
    while IFS= read -r file; do
      [ "$TOP/$file" -nt "$TOP/build/inputs" ] || touch "$TOP/$file"
    done || true
}

run_make() {
  local log=$TOP/$BUILD/build.log jobs=${JOBS:-$(nproc)} options folders=()
  mapfile -t options < <(build_options)
  [ "$BUILD" = build ] ||
    folders=(--build "$BUILD" "-DCATKIN_DEVEL_PREFIX=$TOP/$BUILD/devel")
  if ! (
    cd "$TOP"
    if use_noetic; then source_setup /opt/ros/noetic/setup.bash; fi
    # once configured, make alone sees what has changed, and is much quicker about it
    if [ -f "$BUILD/Makefile" ] && [ "${options[*]}" = "$(cat "$BUILD/options" 2> /dev/null)" ]; then
      make -C "$BUILD" -j"$jobs" "$@" 2>&1 | tee "$log" | show_progress
    else
      catkin_make "${folders[@]}" -j"$jobs" "${options[@]}" "$@" 2>&1 |
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

# Builds the given targets, of which `all` comes first, into the folder BUILD; without any, all,
# where something has changed.
build() {
  [ $# -gt 0 ] || ! is_built || return 0
  setup
  mkdir -p "$TOP/$BUILD"
  local lock before
  exec {lock}> "$TOP/$BUILD/lock"
  if ! flock -n "$lock"; then
    echo "waiting for another ./pmeta that builds"
    flock "$lock"
  fi
  touch_what_changed
  before=$(inputs)
  run_make "$@"
  if [ "${1:-all}" = all ]; then
    echo "$before" > "$TOP/build/inputs"
    products > "$TOP/build/products"
  fi
  exec {lock}>&-
}

ensure_built() {
  build
  source_setup "$TOP/devel/setup.bash"
  source_overlays
  # nodes talk on this machine only, unless the user says otherwise
  [ -n "${ROS_IP:-}${ROS_HOSTNAME:-}" ] || export ROS_IP=127.0.0.1
  export ROSCONSOLE_STDOUT_LINE_BUFFERED=1
}

