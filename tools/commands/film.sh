# Results: a film of trained policies, as rviz shows them
#
# usage: ./pmeta film EXPERIMENT|RUN [-o FILE] [--seconds N] [best:=true] [speed:=N] [rviz_config:=FILE]
#
# EXPERIMENT and RUN are those of ./pmeta show. The film, of 12 seconds unless told otherwise, goes to
# FILE (EXPERIMENT.mp4); its ending says the format: .mp4, .webm, .gif.
#
# Example: ./pmeta film half_cheetah_dir -o cheetah.gif --seconds 6

. "$TOP/tools/launch.sh"
. "$TOP/tools/screen.sh"

FRAME_RATE=15
WIDTH=960

command_main() {
  [ $# -ge 1 ] || die "which policies? See ./pmeta film --help."
  local name=$1 folder file seconds=12 assignments=()
  folder=$(policies_of "$name")
  file=$PWD/$(basename "$folder").mp4
  shift
  while [ $# -gt 0 ]; do
    case $1 in
      -o | --seconds)
        [ $# -ge 2 ] || die "$1 needs a word after it."
        if [ "$1" = -o ]; then file=$2; else seconds=$2; fi
        shift ;;
      *) assignments+=("$1") ;;
    esac
    shift
  done
  require_assignments "${assignments[@]}"
  [[ $seconds =~ ^[1-9][0-9]{0,3}$ ]] || die "--seconds is '$seconds' but must be a whole number from 1 to 9999."
  [ -d "$(dirname "$file")" ] || die "there is no folder $(dirname "$file") for the film."
  setup "${PACKAGES_SCREENSHOT[@]}" "${PACKAGES_FILM[@]}"
  ensure_built

  prepare_screen
  start_screen
  echo "showing $name with rviz on a screen in memory"
  launch_on_screen --skip-log-check pmeta_nodes show.launch "run:=$folder" "${assignments[@]}"
  wait_until 300 "rviz" rviz_listens
  sleep 8  # rviz has drawn, and all episodes are on their way
  # never half a film under its name
  local made=$SCREEN_DIR/film.${file##*.}
  # how long is said of the input: a GIF's palette waits for its end
  ffmpeg -nostdin -loglevel error -y -f x11grab -framerate "$FRAME_RATE" -video_size "$SCREEN_SIZE" \
    -t "$seconds" -i "$DISPLAY" -vf "$(filter_of "$file")" "$made" || die "the film could not be made."
  mv "$made" "$file"
  leave_screen
  echo "film: $file"
}

# of a GIF the colours are the film's own
filter_of() {
  local scale="scale=$WIDTH:-2:flags=lanczos"
  case $1 in
    *.gif) echo "$scale,split[a][b];[a]palettegen=max_colors=64[p];[b][p]paletteuse=dither=none" ;;
    *) echo "$scale,format=yuv420p" ;;
  esac
}
