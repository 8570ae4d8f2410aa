# What every command has at hand.

PYTHON=/usr/bin/python3
SCRIPTS=$TOP/src/pmeta_nodes/scripts

. "$TOP/tools/packages.sh"
. "$TOP/tools/build.sh"

die() {
  echo "pmeta: $*" >&2
  exit 1
}

# argument: command, then its words, of which it takes none
takes_no_words() { [ $# = 1 ] || die "'$2' is too much: see ./pmeta $1 --help."; }

# each of the words must be key:=value
require_assignments() {
  local word
  for word in "$@"; do
    [[ $word == ?*:=* ]] || die "'$word' is not an assignment: write key:=value."
  done
}

# the settings file of an experiment, which is a name of config/ or a file of the user's own
config_of() {
  local file=$TOP/config/$1.yaml
  case $1 in
    */* | *.yaml | *.yml)
      [ -e "$1" ] || die "there is no settings file '$1'."
      file=$(realpath "$1") ;;
    *)
      [ -f "$file" ] ||
        die "unknown experiment '$1'; known are: $(find "$TOP/config" -maxdepth 1 -name '*.yaml' -printf '%f\n' | sed 's/\.yaml$//' | sort | xargs)." ;;
  esac
  echo "$file"
}

pmeta_local() { "$TOP/devel/lib/pmeta_core/pmeta_local" "$@"; }
