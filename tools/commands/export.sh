# Results: a trained policy as an ONNX model, for machines without pMeta
#
# Example: ./pmeta export ~/.ros/pmeta/cart_pole/RUN/policies/task_0.safetensors -o policy.onnx

more_help() { "$PYTHON" "$SCRIPTS/export.py" --help; }

command_main() {
  ! use_noetic || die "Ubuntu 20.04 has no ONNX package for Python: export needs Debian 12."
  setup "${PACKAGES_ONNX[@]}"
  "$PYTHON" "$SCRIPTS/export.py" "$@"
}
