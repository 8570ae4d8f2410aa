# Learn: every setting of an experiment: its value, the default and its meaning
#
# usage: ./pmeta settings EXPERIMENT [key:=value ...]
#        ./pmeta settings mjcf
#
# EXPERIMENT is a file of config/ without .yaml, or the path of a settings file of your own. mjcf lists
# the terms of which the environment of a robot of your own is made (docs/your_robot.md). Those of machines are
# shown for a file that names some (docs/ros.md).
#
# Examples:
#   ./pmeta settings cart_pole
#   ./pmeta settings cart_pole preset:=quick
#   ./pmeta settings my_experiment.yaml

command_main() {
  [ $# -ge 1 ] || die "which experiment? See ./pmeta settings --help."
  local config=mjcf
  [ "$*" = mjcf ] || config=$(config_of "$1")
  ensure_built
  pmeta_local settings "$config" "${@:2}"
}
