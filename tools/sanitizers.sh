# The tests under sanitizers.

# Rostests that run under sanitizers: all but the panel's, since rviz and Qt are not instrumented,
# and the runs that differ from these in settings alone.
SANITIZED_ROSTESTS="equals_local equals_local_cart_pole equals_local_half_cheetah_dir late_joiner pause policy_node
  privacy refusal respawn trajectory_view"

# arguments: a name for people, the folder to build in, compiler options
sanitize() {
  local what=$1 results log name programs=() rostests=()
  BUILD=$2
  BUILD_OPTIONS=(-DCMAKE_BUILD_TYPE=None "-DCMAKE_CXX_FLAGS=-O1 -g1 $3 -fno-omit-frame-pointer")
  for name in $SANITIZED_ROSTESTS; do
    rostests+=("run_tests_pmeta_nodes_rostest_test_nodes_$name.test")
    programs+=("${name}_test")
  done
  # rostests that share a program are named after it
  programs=("${programs[@]/#equals_local_*_test/equals_local_test}")
  build core_test nodes_test meta_aggregator policy_node prepare_run task_agent trajectory_view "${programs[@]}"
  source_setup "$TOP/$BUILD/devel/setup.bash"
  export ROS_HOME=$TOP/$BUILD/ros_home ROSCONSOLE_STDOUT_LINE_BUFFERED=1 ROS_IP=127.0.0.1
  unset ROS_MASTER_URI DISPLAY
  results=$TOP/$BUILD/test_results
  log=$TOP/$BUILD/tests.log
  rm -rf "$results" "$TOP/$BUILD/reports"
  mkdir -p "$TOP/$BUILD/reports"
  # nodes that roslaunch stops tell nobody their exit code: a report is a file
  local options=log_path=$TOP/$BUILD/reports/report
  # what does not fit into memory is refused, which tests rely on
  export ASAN_OPTIONS=$options:allocator_may_return_null=1 UBSAN_OPTIONS=$options:print_stacktrace=1
  # roscpp is not instrumented: what it does among its own threads looks like races
  export TSAN_OPTIONS=$options:ignore_noninstrumented_modules=1
  TSAN_OPTIONS+=:suppressions=$TOP/test/tsan.supp:print_suppressions=0
  echo "running the tests under $what; output in $BUILD/tests.log"
  : > "$log"
  for name in run_tests_pmeta_core_gtest_core_test run_tests_pmeta_nodes_gtest_nodes_test "${rostests[@]}"; do
    make -C "$TOP/$BUILD" -j1 "$name" >> "$log" 2>&1 ||
      { tail -n 60 "$log" >&2; die "the tests could not be run."; }
  done
  local failed=0 reports
  "$PYTHON" "$TOP/test/count_results.py" "$results" || failed=1
  reports=$(find "$TOP/$BUILD/reports" -type f | sort)
  if [ -z "$reports" ]; then
    echo "no reports of $what"
  else
    head -n 40 "$(head -n 1 <<< "$reports")" >&2
    echo "$(wc -l <<< "$reports") reports of $what in $BUILD/reports" >&2
    failed=1
  fi
  return $failed
}

# argument: the option of ./pmeta test
sanitize_with() {
  case $1 in
    --asan)
      sanitize "AddressSanitizer and UndefinedBehaviorSanitizer" build_asan \
        "-fsanitize=address,undefined -fno-sanitize-recover=undefined" ;;
    --tsan) sanitize ThreadSanitizer build_tsan -fsanitize=thread ;;
  esac
}
