# Build: build into build/ and devel/
#
# usage: ./pmeta build
#
# Every command does this first where something has changed.
#
# Example: JOBS=4 ./pmeta build

command_main() {
  takes_no_words build "$@"
  build
}
