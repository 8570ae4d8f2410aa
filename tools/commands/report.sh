# Results: one HTML file with settings, tables and figures of runs or sweeps
#
# Example: ./pmeta report ~/.ros/pmeta/sweeps/gridworld -o report.html

more_help() { "$PYTHON" "$SCRIPTS/report.py" --help; }

command_main() { "$PYTHON" "$SCRIPTS/report.py" "$@"; }
