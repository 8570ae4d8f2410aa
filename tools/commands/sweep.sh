# Learn: every combination of values, without ROS, on all cores
#
# usage: ./pmeta sweep EXPERIMENT key:=a,b,c ... [--name NAME] [--jobs N] [--resume] [--dry-run]
#
# seed:=0-9 is a range. The same command again goes on where it stopped. Draws the figures at its end.
#   --name NAME  of the sweep's folder (the experiment's)
#   --jobs N     runs at a time (one a core)
#   --resume     runs make checkpoints, and one that was cut off goes on from them
#   --dry-run    only list the runs, each with its status: nothing is run or written
#
# Example: ./pmeta sweep gridworld lambda:=1,5,10 seed:=0-9

command_main() {
  [ $# -ge 1 ] || die "which experiment? See ./pmeta sweep --help."
  local config
  config=$(config_of "$1")
  shift
  ensure_built
  if [[ " $* " == *" --dry-run "* ]]; then
    pmeta_local sweep "$config" "$@"
    return
  fi
  local log folder
  log=$(mktemp)
  pmeta_local sweep "$config" "$@" | tee "$log"
  folder=$(sed -n 's/^runs in //p' "$log")
  rm -f "$log"
  "$TOP/pmeta" plot "$folder"
}
