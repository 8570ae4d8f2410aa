# Results: lists runs and sweeps and how they stand; removes those no longer wanted
#
# Examples:
#   ./pmeta runs
#   ./pmeta runs ~/.ros/pmeta/sweeps/gridworld
#   ./pmeta runs --remove-unfinished --older-than 7

more_help() { "$PYTHON" "$SCRIPTS/runs.py" --help; }

command_main() { "$PYTHON" "$SCRIPTS/runs.py" "$@"; }
