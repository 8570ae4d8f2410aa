# Learn: roslaunch an experiment
#
# usage: ./pmeta run EXPERIMENT [key:=value ...]
#
# EXPERIMENT is a file of config/ without .yaml, or the path of a settings file of your own. A key is
# any setting (./pmeta settings EXPERIMENT) or any launch argument (roslaunch --ros-args pmeta_nodes
# experiment.launch lists them), e.g.
#   rviz:=true       watch it in rviz, which stays open after the last round
#   speed:=2         how fast rviz plays episodes
#   hold:=true       stay after the last round until Ctrl-C
#   record:=true     record all topics beside the run folder
#   ns:=NAME         nodes and topics below /NAME/pmeta, for several runs on one ROS master
#   resume:=RUN_DIR  go on with a run that was stopped or killed
#   agents:=false    agents run elsewhere. Settings may name machines for them: docs/ros.md
#
# Examples:
#   ./pmeta run gridworld lambda:=5 seed:=1 rviz:=true
#   ./pmeta run cart_pole resume:=RUN

. "$TOP/tools/launch.sh"

command_main() {
  [ $# -ge 1 ] || die "which experiment? See ./pmeta run --help."
  [ "$1" != convergence ] || exec "$TOP/pmeta" "$@"
  prepare_launch "$@"
  local launched=0
  echo "starting the aggregator and $AGENTS agent$([ "$AGENTS" = 1 ] || echo s)"
  # its look at all logs takes long where there are many
  roslaunch --skip-log-check "${LAUNCH[@]}" || launched=$?

  # roslaunch ends with 0 even after a crash: the run folder is what counts
  local status
  status=$(run_status)
  case $status in
    finished)
      echo "results: $RUN_DIR"
      printf 'figures: ./pmeta plot %q\n' "$RUN_DIR" ;;
    stopped)
      echo "pmeta: the run was stopped before its last round; what was done is in $RUN_DIR" >&2
      exit 130 ;;
    *)
      die "the run did not finish (status '${status:-none}', roslaunch ended with $launched); see $RUN_DIR and ~/.ros/log." ;;
  esac
}
