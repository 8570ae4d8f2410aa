# Build: install what is missing from Debian
#
# usage: ./pmeta setup
#
# Needs to be root, or asks for it by sudo. Every command that builds does this first.
#
# Example: ./pmeta setup

command_main() {
  takes_no_words setup "$@"
  setup
}
