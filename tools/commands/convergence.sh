# Learn: measure the statements of the theory on known models
#
# usage: ./pmeta convergence [key:=value ...]
#
# Example: ./pmeta convergence seed:=1

command_main() {
  require_assignments "$@"
  ensure_built
  pmeta_local convergence "$(config_of convergence)" "$@"
}
