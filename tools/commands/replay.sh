# Check: simulate a recorded trajectory again and compare
#
# usage: ./pmeta replay KIND FILE [--tasks FILE]
#
# KIND is cartpole, mountaincar, half_cheetah, ant, walker2d, walker2d_params, sparse_point,
# half_cheetah_model, ant_model or walker2d_model; FILE a table, as test/data has of each.
#   --tasks FILE  the tasks of the trajectories, where they are not the paper's
#
# Example: ./pmeta replay cartpole test/data/cartpole.csv

command_main() {
  [ $# -ge 2 ] || die "which kind and file? See ./pmeta replay --help."
  ensure_built
  pmeta_local replay "$@"
}
