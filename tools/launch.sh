# From the words of run and screenshot to what roslaunch is called with.

# Builds, checks an experiment's key:=value assignments, and sets LAUNCH (what roslaunch is called
# with), RUN_DIR and AGENTS (how many).
prepare_launch() {
  local experiment=$1 config file=$1.launch checked
  shift
  config=$(config_of "$experiment")
  LAUNCH=()
  if [ "$config" != "$TOP/config/$experiment.yaml" ]; then
    file=experiment.launch
    LAUNCH=("config:=$config")
  fi
  [ -f "$TOP/launch/$file" ] || die "$experiment has no launch file in launch/."
  require_assignments "$@"
  ensure_built

  # what is wrong is told here, in a sentence, before anything starts
  checked=$("$TOP/devel/lib/pmeta_nodes/prepare_run" --check "$TOP/launch/$file" "$config" "$@")
  { read -r RUN_DIR; read -r AGENTS; } <<< "$checked"
  # without it the name would be that of the second in which roslaunch reads this
  case " $*" in
    *" run_id:="?* | *" resume:="?*) ;;
    *) LAUNCH+=("run_id:=$(basename "$RUN_DIR")") ;;
  esac
  LAUNCH=(pmeta_nodes "$file" "${LAUNCH[@]}" "$@")
}

# of the run in RUN_DIR
run_status() { sed -n 's/^ *"status": "\(.*\)",$/\1/p' "$RUN_DIR/manifest.json" 2> /dev/null || true; }

# the folder with the policies that a word means
policies_of() {
  local shipped=$TOP/config/policies
  if [ -d "$1" ]; then
    realpath "$1"
  elif [ -d "$shipped/$1" ]; then
    echo "$shipped/$1"
  else
    die "'$1' is neither the folder of a run nor a set with shipped policies, which are: $(find "$shipped" -mindepth 1 -maxdepth 1 -type d -printf '%f\n' | sort | xargs)."
  fi
}
