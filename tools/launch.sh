# From the words of run and screenshot to what roslaunch is called with.

# value of a top-level key in YAML on standard input
yaml_value() { sed -n "s/^$1: *//p" | sed 's/^"\(.*\)"$/\1/'; }

# Checks an experiment's key:=value assignments, builds, and sets LAUNCH (what roslaunch is called
# with) and RUN_DIR.
prepare_launch() {
  local experiment=$1 config
  shift
  config=$(config_of "$experiment")
  [ -f "$TOP/launch/$experiment.launch" ] || die "$experiment has no launch file in launch/."
  local assignments=() extra=() assignment
  LAUNCH=(pmeta_nodes "$experiment.launch")
  for assignment in "$@"; do
    case $assignment in
      rviz:=* | view:=* | view_prefix:=* | speed:=* | hold:=* | record:=*) LAUNCH+=("$assignment") ;;
      settings:=*) die "settings:= is for roslaunch; here give each setting as key:=value." ;;
      preset:=* | seed:=* | algorithm:=* | lambda:=* | rounds:=* | pace:=* | results_dir:=* | run_id:=* | \
        key_file:=* | resume:=*)
        assignments+=("$assignment")
        LAUNCH+=("$assignment") ;;
      ?*:=*)
        assignments+=("$assignment")
        extra+=("${assignment/:=/=}") ;;
      *) die "'$assignment' is not an assignment: write key:=value." ;;
    esac
  done
  ensure_built

  # bad settings are told here, in a sentence, before anything starts
  local effective
  effective=$(pmeta_local check "$config" "${assignments[@]}")
  case " ${assignments[*]} " in
    *" run_id:="* | *" resume:="*) ;;
    *) LAUNCH+=("run_id:=$(yaml_value run_id <<< "$effective")") ;;
  esac
  [ ${#extra[@]} = 0 ] || LAUNCH+=("settings:=${extra[*]}")
  RUN_DIR=$(yaml_value results_dir <<< "$effective")/$(yaml_value experiment <<< "$effective")/$(yaml_value run_id <<< "$effective")
}

# of the run in RUN_DIR
run_status() { sed -n 's/^ *"status": "\(.*\)",$/\1/p' "$RUN_DIR/manifest.json" 2> /dev/null || true; }

