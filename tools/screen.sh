# A screen in memory, for programs that draw, with a ROS master of its own.

SCREEN_SIZE=1640x800

# Waits until a command succeeds; arguments: seconds, what for, the command.
wait_until() {
  local limit=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    [ $SECONDS -lt $limit ] || die "waited too long for $what."
    kill -0 "$LAUNCHED" 2> /dev/null || die "the launch ended before $what; see $SCREEN_DIR."
    sleep 0.5
  done
}

rviz_listens() { rostopic info /pmeta/markers 2> /dev/null | grep -q rviz; }

# SCREEN_DIR is a folder for what is short-lived: while it is empty it goes whatever happens.
prepare_screen() {
  SCREEN_DIR=$(mktemp -d)
  trap end_screen EXIT
}

# Sets DISPLAY, ROS_MASTER_URI and what rviz needs there.
start_screen() {
  local port
  Xvfb -displayfd 3 -screen 0 "$SCREEN_SIZE"x24 +extension GLX -nolisten tcp \
    3> "$SCREEN_DIR/display" 2> "$SCREEN_DIR/xvfb.log" &
  SCREEN=$!
  port=$("$PYTHON" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
  export ROS_MASTER_URI=http://127.0.0.1:$port ROS_LOG_DIR=$SCREEN_DIR/log
  export LIBGL_ALWAYS_SOFTWARE=1 QT_X11_NO_MITSHM=1 XDG_RUNTIME_DIR=$SCREEN_DIR
  LAUNCHED=$SCREEN
  wait_until 30 "the screen" test -s "$SCREEN_DIR/display"
  DISPLAY=:$(cat "$SCREEN_DIR/display")
  export DISPLAY
}

# roslaunch there, in the background; argument: those of roslaunch
launch_on_screen() {
  roslaunch "$@" > "$SCREEN_DIR/launch.log" 2>&1 &
  LAUNCHED=$!
}

end_screen() {
  local process
  for process in ${LAUNCHED:-} ${SCREEN:-}; do
    { kill "$process" && wait "$process"; } 2> /dev/null || true
  done
  rmdir "$SCREEN_DIR" 2> /dev/null || true
}

# the same where all went well: what is short-lived goes
leave_screen() {
  end_screen
  trap - EXIT
  rm -rf "$SCREEN_DIR"
}
