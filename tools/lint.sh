# Habits that programs can check. Each function prints what it finds and fails if that is anything.

# what is quick and needs no build
lint_quick() (
  cd "$TOP" || exit
  local failed=0 sources
  mapfile -t sources < <(git ls-files --cached --others --exclude-standard '*.cpp' '*.h')
  clang-format-14 --dry-run -Werror "${sources[@]}" || failed=1
  shellcheck pmeta .ci/run tools/*.sh tools/commands/*.sh || failed=1
  pyflakes3 src/pmeta_nodes/scripts src/pmeta_nodes/python examples test tools || failed=1
  lint_docs || failed=1
  return $failed
)

# The API reference, in which each public symbol must be documented; it is in build/docs then.
lint_docs() (
  cd "$TOP" || exit
  rm -rf build/docs
  mkdir -p build/docs
  doxygen docs/Doxyfile
)

# Checks of .clang-tidy on the given C++ files.
lint_tidy() (
  cd "$TOP" || exit
  [ $# -gt 0 ] || return 0
  local log=build/clang_tidy.log
  echo "clang-tidy on $# files"
  # Clang cannot read headers that GCC has precompiled
  mkdir -p build/tidy
  sed 's# -include [^ ]*/cmake_pch\.hxx##' build/compile_commands.json > build/tidy/compile_commands.json
  # what it says besides: how many warnings there are in the headers of others
  if ! printf '%s\0' "$@" |
    xargs -0 -n 1 -P "${JOBS:-$(nproc)}" clang-tidy-14 -p build/tidy --quiet > "$log" 2> /dev/null; then
    cat "$log"
    return 1
  fi
)

# C++ files, of which there is a compile command: those that differ from the commit before the last
changed_sources() (
  cd "$TOP" || exit
  { git diff --name-only --diff-filter=d "$(git rev-parse --quiet --verify HEAD~1 || echo HEAD)"
    git ls-files --others --exclude-standard; } | grep '\.cpp$' | sort -u | compiled_sources
)

all_sources() (
  cd "$TOP" || exit
  git ls-files '*.cpp' | compiled_sources
)

# of the names in the input those that are compiled
compiled_sources() { grep -xFf <(sed -n "s#^ *\"file\": \"$TOP/\(.*\)\".*#\1#p" build/compile_commands.json) || true; }

# What catkin_lint cannot know: tests, launch and settings files are beside the packages, not in
# them; scripts are modules, too; pmeta_core builds without catkin, too; who builds against
# pmeta_nodes, scenes and servers of robots, needs no more than its headers include.
CATKIN_LINT_IGNORES=(MISSING_FILE EXTERNAL_FILE MISSING_DIRECTORY EXTERNAL_DIRECTORY MISSING_SHEBANG
  UNINSTALLED_SCRIPT UNINSTALLED_TARGET MISSING_REQUIRED UNINSTALLED_INCLUDE_PATH
  WRONG_INSTALL_DESTINATION MISSING_CATKIN_DEPEND)

lint_catkin() { catkin_lint --offline --strict --quiet "${CATKIN_LINT_IGNORES[@]/#/--ignore=}" "$TOP/src"; }
