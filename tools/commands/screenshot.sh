# Results: a short run with rviz on a screen in memory, and its picture
#
# usage: ./pmeta screenshot EXPERIMENT [key:=value ...] [-o FILE]
#
# The picture at the run's end goes to FILE (EXPERIMENT.png). Unless told otherwise the run has three
# rounds, and the preset quick if the experiment has one.
#
# Example: ./pmeta screenshot half_cheetah_dir -o cheetah.png

. "$TOP/tools/launch.sh"
. "$TOP/tools/screen.sh"

run_ended() { [[ $(run_status) == finished ]]; }

command_main() {
  [ $# -ge 1 ] || die "which experiment? See ./pmeta screenshot --help."
  local experiment=$1 file assignments=() config
  config=$(config_of "$experiment")
  file=$PWD/$(basename "${config%.*}").png
  shift
  while [ $# -gt 0 ]; do
    case $1 in
      -o)
        [ $# -ge 2 ] || die "-o needs a file."
        file=$2
        shift ;;
      *) assignments+=("$1") ;;
    esac
    shift
  done
  [ -d "$(dirname "$file")" ] || die "there is no folder $(dirname "$file") for the picture."
  setup "${PACKAGES_SCREENSHOT[@]}"

  # a short run of its own, where nothing else is asked for
  prepare_screen
  local given=" ${assignments[*]} "
  [[ $given == *" results_dir:="* ]] || assignments+=("results_dir:=$SCREEN_DIR/results")
  [[ $given == *" rounds:="* ]] || assignments+=(rounds:=3)
  [[ $given == *" preset:="* ]] || ! grep -q '^  quick:' "$config" || assignments+=(preset:=quick)
  # at idle priority rviz might never come up on a machine that is busy
  prepare_launch "$experiment" "${assignments[@]}" rviz:=true view_prefix:=env

  start_screen
  echo "running $experiment with rviz on a screen in memory"
  launch_on_screen "${LAUNCH[@]}"
  wait_until 3600 "the last round" run_ended
  wait_until 120 "rviz" rviz_listens
  sleep 10  # rviz has drawn, and episodes are on their way
  import -window root png:- | convert png:- -strip +dither -colors 256 "PNG8:$file" ||
    die "the picture could not be taken."
  leave_screen
  echo "picture: $file"
}
