# Results: a short run with rviz on a screen in memory, and its picture
#
# usage: ./pmeta screenshot EXPERIMENT [key:=value ...] [-o FILE]
#
# The picture at the run's end goes to FILE (EXPERIMENT.png). Unless told otherwise the run has three
# rounds, and the preset quick if the experiment has one.
#
# Example: ./pmeta screenshot half_cheetah_dir -o cheetah.png

. "$TOP/tools/launch.sh"

# Waits until a command succeeds; arguments: seconds, what for, the command.
wait_until() {
  local limit=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    [ $SECONDS -lt $limit ] || die "waited too long for $what."
    kill -0 "$LAUNCHED" 2> /dev/null || die "the launch ended before $what; see $SCREENSHOT_DIR."
    sleep 0.5
  done
}

run_ended() { [[ $(run_status) == finished ]]; }
rviz_listens() { rostopic info /pmeta/markers 2> /dev/null | grep -q rviz; }

end_screenshot() {
  local process
  for process in ${LAUNCHED:-} ${SCREEN:-}; do
    { kill "$process" && wait "$process"; } 2> /dev/null || true
  done
  rmdir "$SCREENSHOT_DIR" 2> /dev/null || true
}

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
  SCREENSHOT_DIR=$(mktemp -d)
  trap end_screenshot EXIT
  local given=" ${assignments[*]} "
  [[ $given == *" results_dir:="* ]] || assignments+=("results_dir:=$SCREENSHOT_DIR/results")
  [[ $given == *" rounds:="* ]] || assignments+=(rounds:=3)
  [[ $given == *" preset:="* ]] || ! grep -q '^  quick:' "$config" || assignments+=(preset:=quick)
  # at idle priority rviz might never come up on a machine that is busy
  prepare_launch "$experiment" "${assignments[@]}" rviz:=true view_prefix:=env

  # a screen and a master of its own
  Xvfb -displayfd 3 -screen 0 1640x800x24 +extension GLX -nolisten tcp \
    3> "$SCREENSHOT_DIR/display" 2> "$SCREENSHOT_DIR/xvfb.log" &
  SCREEN=$!
  local port
  port=$("$PYTHON" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
  export ROS_MASTER_URI=http://127.0.0.1:$port ROS_LOG_DIR=$SCREENSHOT_DIR/log
  export LIBGL_ALWAYS_SOFTWARE=1 QT_X11_NO_MITSHM=1 XDG_RUNTIME_DIR=$SCREENSHOT_DIR
  LAUNCHED=$SCREEN
  wait_until 30 "the screen" test -s "$SCREENSHOT_DIR/display"
  DISPLAY=:$(cat "$SCREENSHOT_DIR/display")
  export DISPLAY

  echo "running $experiment with rviz on a screen in memory"
  roslaunch "${LAUNCH[@]}" > "$SCREENSHOT_DIR/launch.log" 2>&1 &
  LAUNCHED=$!
  wait_until 3600 "the last round" run_ended
  wait_until 120 "rviz" rviz_listens
  sleep 10  # rviz has drawn, and episodes are on their way
  import -window root png:- | convert png:- -strip +dither -colors 256 "PNG8:$file" ||
    die "the picture could not be taken."
  end_screenshot
  trap - EXIT
  rm -rf "$SCREENSHOT_DIR"
  echo "picture: $file"
}
