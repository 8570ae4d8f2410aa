# Build: make a key, with which a run authenticates its messages
#
# usage: ./pmeta key FILE
#
# FILE must not be there; give it to every node of a run as key_file:=FILE.
#
# Example: ./pmeta key ~/run.key

command_main() {
  [ $# = 1 ] || die "which file? See ./pmeta key --help."
  ensure_built
  pmeta_local key "$@"
}
