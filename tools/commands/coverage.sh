# Check: how many lines of the core and the nodes the C++ unit tests reach
#
# usage: ./pmeta coverage
#
# Builds in a folder of its own, build_coverage, which then holds the lines that are not reached
# (coverage.txt), and ends with the share of those that are.
#
# Example: ./pmeta coverage

command_main() {
  takes_no_words coverage "$@"
  setup "${PACKAGES_COVERAGE[@]}"
  BUILD=build_coverage
  BUILD_OPTIONS=(-DCMAKE_BUILD_TYPE=None "-DCMAKE_CXX_FLAGS=-O1 --coverage")
  build core_test nodes_test
  source_setup "$TOP/$BUILD/devel/setup.bash"
  export ROS_HOME=$TOP/$BUILD/ros_home ROS_IP=127.0.0.1
  local results=$TOP/$BUILD/test_results log=$TOP/$BUILD/tests.log name
  rm -rf "$results"
  find "$TOP/$BUILD" -name '*.gcda' -delete
  echo "running the unit tests; output in $BUILD/tests.log"
  : > "$log"
  for name in pmeta_core_gtest_core_test pmeta_nodes_gtest_nodes_test; do
    make -C "$TOP/$BUILD" -j1 "run_tests_$name" >> "$log" 2>&1 ||
      { tail -n 60 "$log" >&2; die "the tests could not be run."; }
  done
  "$PYTHON" "$TOP/test/count_results.py" "$results" || true
  gcovr --root "$TOP" --filter "$TOP/src/" "$TOP/$BUILD" --txt "$TOP/$BUILD/coverage.txt" --print-summary |
    sed -n 's/^lines: \(.*%\).*(\(.*\) out of \(.*\)).*/\1 of the lines: \2 of \3/p'
}
