# Build: the API reference, as web pages
#
# usage: ./pmeta docs
#
# Makes build/docs/html/index.html by Doxygen. A public symbol without a comment is an error, and so
# is whatever Doxygen warns of; ./pmeta lint and ./pmeta test look for these, too.
#
# Example: ./pmeta docs

. "$TOP/tools/lint.sh"

command_main() {
  takes_no_words docs "$@"
  setup "${PACKAGES_LINT_QUICK[@]}"
  lint_docs || die "what is above needs mending: each public symbol says what it is."
  echo "the reference is in build/docs/html/index.html"
}
