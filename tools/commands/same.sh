# Check: does another build learn the same, bit for bit?
#
# usage: ./pmeta same TREE [NAME ...]
#
# TREE is another clone that is built, of the version before a change, say. Short runs of every
# experiment set and algorithm (tools/same_runs.txt; with NAMEs only those) are made by both, and
# their rounds.csv (but wall_s) and the parameters of their policies compared. Exits with 1 where
# they differ. Both must be built with the same options on the same machine.
#
# Example: ./pmeta same ../pmeta-before

command_main() {
  [[ $# -ge 1 ]] || die "./pmeta same needs the folder of another clone that is built."
  local other=$1
  [[ -x $other/devel/lib/pmeta_core/pmeta_local ]] ||
    die "there is no built clone in $other: ./pmeta build there first."
  ensure_built
  "$PYTHON" "$TOP/tools/same.py" "$other" "$TOP" "${@:2}"
}
