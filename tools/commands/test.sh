# Check: set up, lint, build and run every test
#
# usage: ./pmeta test [--asan | --tsan]
#
#   --asan  the C++ tests again under AddressSanitizer and UndefinedBehaviorSanitizer
#   --tsan  the C++ tests again under ThreadSanitizer
# Each of these has a build folder of its own, build_asan or build_tsan.
#
# Example: ./pmeta test

. "$TOP/tools/lint.sh"

# the tests of one Python file, whose output is shown when they have ended; argument: the folder of results
run_file() {
  local results=$1 file=$2 output name
  name=$(basename "$file" .py)
  output=$("$PYTHON" -m pytest -q -p no:cacheprovider "$file" --junitxml="$results/$name.xml" 2>&1) || true
  [ -f "$results/$name.xml" ] || touch "$results/MISSING-$name.xml"
  printf '%s\n%s\n' "$file" "$output"
}

run_python_tests() (
  cd "$TOP" || exit
  export PYTHON
  export -f run_file
  printf '%s\n' test/*_test.py | xargs -P 2 -n 1 bash -c 'run_file "$@"' _ "$1"
)

run_tests() {
  # Ubuntu has no Chromium package but a snap: there the tests that need such programs are skipped
  if ! use_noetic; then
    setup "${PACKAGES_TEST[@]}" "${PACKAGES_SCREENSHOT[@]}" "${PACKAGES_LINT_QUICK[@]}"
    lint_quick || die "what is above needs mending; see ./pmeta lint --help."
  fi
  build all tests
  source_setup "$TOP/devel/setup.bash"
  export ROS_HOME=$TOP/build/ros_home ROSCONSOLE_STDOUT_LINE_BUFFERED=1 ROS_IP=127.0.0.1
  unset ROS_MASTER_URI DISPLAY
  local results=$TOP/build/test_results
  rm -rf "$results"
  mkdir -p "$results/front_door"
  echo "running the tests; output of those in C++ in build/tests.log"
  # Most of the time tests of either kind wait for processes: there are three rows of them. With job
  # control, or what is in the background would ignore SIGINT
  set -m
  make -C "$TOP/build" -j1 run_tests > "$TOP/build/tests.log" 2>&1 &
  local cpp_tests=$!
  set +m
  # shellcheck disable=SC2064
  trap "kill -- -$cpp_tests 2> /dev/null || true" EXIT
  run_python_tests "$results/front_door"
  # this ends with 0 when tests fail: the result files are what counts
  wait "$cpp_tests" || { tail -n 60 "$TOP/build/tests.log" >&2; die "the tests could not be run."; }
  trap - EXIT
  "$PYTHON" "$TOP/test/count_results.py" "$results"
}

command_main() {
  case ${1:-} in
    '') run_tests ;;
    --asan | --tsan)
      . "$TOP/tools/sanitizers.sh"
      sanitize_with "$1" ;;
    *) die "unknown option '$1' of test: see ./pmeta test --help." ;;
  esac
}
