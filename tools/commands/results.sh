# Results: the pages of docs/results from committed data, and the runs that give it
#
# Examples:
#   ./pmeta results                    # tables and figures anew
#   ./pmeta results --status
#   ./pmeta results --run --hours 8    # what is missing, by priority; the same command goes on

more_help() { "$PYTHON" "$SCRIPTS/results.py" --help; }

command_main() {
  case " $* " in
    *" --run "* | *" --status "* | *" --import "*) ensure_built ;;
  esac
  "$PYTHON" "$SCRIPTS/results.py" "$@"
}
