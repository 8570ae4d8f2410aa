# Learn: every setting with its meaning
#
# usage: ./pmeta settings [ENVIRONMENT]
#
# Example: ./pmeta settings cart_pole

command_main() {
  ensure_built
  pmeta_local settings "$@"
}
