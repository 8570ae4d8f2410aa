# Check: runs with nodes killed, messages harmed or the network down: is anything lost?
#
# Example: ./pmeta chaos gridworld --kills 5

more_help() { "$PYTHON" "$SCRIPTS/chaos.py" --help; }

command_main() {
  ensure_built
  "$PYTHON" "$SCRIPTS/chaos.py" "$@"
}
