# Check: format, and mistakes that programs can find
#
# usage: ./pmeta lint [--quick | --all]
#
# Goes over the code with clang-format, shellcheck, pyflakes and Doxygen (is each public symbol
# documented?), over the ROS packages with catkin_lint, and with clang-tidy over the C++ files that
# differ from the commit before the last.
#
#   --quick  the first four alone, which ./pmeta test runs, too
#   --all    clang-tidy over all C++ files: about half an hour on two cores
#
# Example: ./pmeta lint

. "$TOP/tools/lint.sh"

command_main() {
  local failed=0 sources
  case ${1:-} in
    '' | --quick | --all) ;;
    *) die "unknown option '$1' of lint: see ./pmeta lint --help." ;;
  esac
  ! use_noetic || die "lint needs Debian 12: Ubuntu 20.04 lacks clang-format 14, whose layout it is."
  setup "${PACKAGES_LINT_QUICK[@]}" "${PACKAGES_LINT[@]}"
  lint_quick || failed=1
  if [ "${1:-}" != --quick ]; then
    lint_catkin || failed=1
    # messages are headers that are made
    build all
    if [ "${1:-}" = --all ]; then
      mapfile -t sources < <(all_sources)
    else
      mapfile -t sources < <(changed_sources)
    fi
    lint_tidy "${sources[@]}" || failed=1
  fi
  [ "$failed" = 0 ] || die "what is above needs mending; 'clang-format-14 -i FILE' does the layout."
  echo "nothing found"
}
