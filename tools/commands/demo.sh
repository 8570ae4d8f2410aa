# Learn: install what is missing, build, learn five gridworlds over ROS, draw figures
#
# usage: ./pmeta demo
#
# Five task agents and a meta-aggregator learn five gridworlds over roslaunch; then the same on five
# seeds, with model averaging beside it, in one process. Ends by naming the run folder and the figures.
#
# Example: ./pmeta demo

command_main() {
  takes_no_words demo "$@"
  local stamp results
  stamp=$(date -u +%Y%m%dT%H%M%S)
  results=${ROS_HOME:-$HOME/.ros}/pmeta/demo_$stamp
  ensure_built
  echo
  echo "five task agents and a meta-aggregator learn five gridworlds over ROS"
  "$TOP/pmeta" run gridworld "results_dir:=$results" run_id:=over_ros
  echo
  echo "the same on 5 seeds, with model averaging beside it, in one process"
  pmeta_local sweep "$TOP/config/gridworld.yaml" seed:=0-4 algorithm:=pmeta,model_averaging \
    "results_dir:=$results" --name seeds | tail -n 3
  echo
  "$TOP/pmeta" plot "$results/sweeps/seeds" --out "$results/figures"
  echo
  echo "run folder: $results/gridworld/over_ros"
  echo "figures:    $results/figures"
}
