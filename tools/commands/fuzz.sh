# Check: feed parsers with arbitrary bytes
#
# usage: ./pmeta fuzz [TARGET ...] [--seconds N]
#
# Targets are the folders of test/fuzz/corpus; all of them unless told otherwise, 60 s each. What is
# found goes to build_fuzz/findings.
#
# Example: ./pmeta fuzz settings --seconds 600

# arguments: target, seconds
fuzz_one() {
  local target=$1 findings=$TOP/build_fuzz/findings/$1 corpus=$TOP/build_fuzz/corpus/$1
  local log=$TOP/build_fuzz/$1.log options=() package=pmeta_core ended=0
  [ "$target" != message ] || package=pmeta_nodes
  mkdir -p "$findings" "$corpus"
  [ ! -f "$TOP/test/fuzz/$target.dict" ] || options=("-dict=$TOP/test/fuzz/$target.dict")
  # what it learns stays in its own folder; test/fuzz/corpus is only read
  "$TOP/build_fuzz/devel/lib/$package/fuzz_$target" "-max_total_time=$2" -print_final_stats=1 -timeout=20 \
    -entropic_scale_per_exec_time=1 -rss_limit_mb=2048 "-artifact_prefix=$findings/" "${options[@]}" "$corpus" "$TOP/test/fuzz/corpus/$target" \
    > "$log" 2>&1 || ended=$?
  local executions coverage
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  coverage=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
  printf '%-10s%12s executions, %6s edges covered, ' "$target" "${executions:-0}" "${coverage:-0}"
  if [ "$ended" = 0 ]; then
    echo "no findings"
  else
    echo "a finding: $(sed -n 's/.*Test unit written to //p' "$log" | tail -n 1), report in build_fuzz/$target.log"
  fi
  return "$ended"
}

command_main() {
  local seconds=60 targets=() known failed=0 target
  mapfile -t known < <(ls "$TOP/test/fuzz/corpus")
  while [ $# -gt 0 ]; do
    case $1 in
      --seconds)
        [[ ${2:-} =~ ^[1-9][0-9]*$ ]] || die "--seconds needs a whole number, at least 1."
        seconds=$2
        shift ;;
      *)
        [[ " ${known[*]} " == *" $1 "* ]] || die "unknown target '$1'; known are: ${known[*]}."
        targets+=("$1") ;;
    esac
    shift
  done
  [ ${#targets[@]} -gt 0 ] || targets=("${known[@]}")
  local clang=clang-14 clangxx=clang++-14
  if use_noetic; then
    clang=clang clangxx=clang++
    setup "${PACKAGES_FUZZ_NOETIC[@]}"
  else
    setup "${PACKAGES_FUZZ_DEBIAN[@]}"
  fi
  BUILD=build_fuzz
  # Clang finds no OpenMP of its own here, which oneDNN would need
  BUILD_OPTIONS=(-DCMAKE_BUILD_TYPE=None "-DCMAKE_C_COMPILER=$clang" "-DCMAKE_CXX_COMPILER=$clangxx"
    -DCATKIN_ENABLE_TESTING=OFF -DPMETA_FUZZ=ON -DPMETA_GEMM=eigen
    "-DCMAKE_CXX_FLAGS=-O1 -g1 -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined \
-fno-omit-frame-pointer")
  build "${targets[@]/#/fuzz_}"
  for target in "${targets[@]}"; do fuzz_one "$target" "$seconds" || failed=1; done
  return $failed
}
