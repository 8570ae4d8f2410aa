# Results: figures and tables from run or sweep folders, learning curves from a bag
#
# Examples:
#   ./pmeta plot ~/.ros/pmeta/sweeps/gridworld
#   ./pmeta plot RUN.bag --out figures

more_help() { "$PYTHON" "$SCRIPTS/plot.py" --help; }

command_main() {
  # Noetic's Python modules, of which bags need one, are not where Python looks
  if use_noetic; then source_setup /opt/ros/noetic/setup.bash; fi
  "$PYTHON" "$SCRIPTS/plot.py" "$@"
}
