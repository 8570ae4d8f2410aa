# Learn: every setting of an experiment: its value, the default and its meaning
#
# usage: ./pmeta settings EXPERIMENT [key:=value ...]
#
# Examples:
#   ./pmeta settings cart_pole
#   ./pmeta settings cart_pole preset:=quick
#   ./pmeta settings my_experiment.yaml

command_main() {
  [ $# -ge 1 ] || die "which experiment? See ./pmeta settings --help."
  local config
  config=$(config_of "$1")
  ensure_built
  pmeta_local settings "$config" "${@:2}"
}
