# Learn: rviz with trained policies, without training
#
# usage: ./pmeta show EXPERIMENT|RUN [best:=true] [speed:=N] [rviz_config:=FILE]
#
# EXPERIMENT is a set whose trained policies are shipped (config/policies), RUN the folder of a run
# that is over. Both policies of each task are evaluated, which takes seconds, and played until
# Ctrl-C; speed:=2 plays them twice as fast, best:=true those that the run had when it was best.
#
# Examples:
#   ./pmeta show half_cheetah_dir
#   ./pmeta show ~/.ros/pmeta/cart_pole/RUN

. "$TOP/tools/launch.sh"

command_main() {
  [ $# -ge 1 ] || die "which policies? See ./pmeta show --help."
  local folder
  folder=$(policies_of "$1")
  shift
  require_assignments "$@"
  ensure_built
  roslaunch --skip-log-check pmeta_nodes show.launch "run:=$folder" "$@"
}
