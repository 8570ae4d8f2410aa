# Check: speed of the inner loops beside the machine's limits
#
# usage: ./pmeta bench [--benchmark_filter=REGEX and the like of Google Benchmark]
#        ./pmeta bench --peers [ROUNDS [UPDATE...]]
#        ./pmeta bench --rviz [PAIRS [key:=value ...]]
#        ./pmeta bench --ros [--seconds N] [--updates R ...] [--hidden UNITS ...]
#                            [--experiment NAME] [--preset NAME] [key=value ...]
#
#   --peers  the DQN and SAC updates (dqn, sac, sac_small) beside PyTorch's, which it installs from
#            Debian
#   --rviz   what watching a run in rviz costs its agents (cart_pole)
#   --ros    what rounds cost over ROS beside the training in them: half_cheetah_dir, preset
#            inference, 30 s for each number of updates a round (20 100 400) with hidden layers of
#            each size (128 560)
#
# Example: ./pmeta bench --benchmark_filter=Dqn

command_main() {
  local program=$TOP/devel/lib/pmeta_core/pmeta_bench
  if [ "${1:-}" = --peers ]; then
    ! use_noetic || die "Ubuntu 20.04 has no PyTorch package: bench --peers needs Debian 12."
    setup "${PACKAGES_PEERS[@]}"
    PMETA_BENCHMARKS=1 build
    "$PYTHON" "$TOP/test/bench/peers.py" "$program" "${@:2}"
    return
  fi
  if [ "${1:-}" = --rviz ]; then
    setup "${PACKAGES_SCREENSHOT[@]}"
    ensure_built
    "$PYTHON" "$TOP/test/bench/rviz_overhead.py" "${@:2}"
    return
  fi
  if [ "${1:-}" = --ros ]; then
    ensure_built
    "$PYTHON" "$TOP/test/bench/ros_rounds.py" "${@:2}"
    return
  fi
  PMETA_BENCHMARKS=1 build
  "$program" "$@"
}
