#include "kernel_tables.h"

namespace pmeta {
namespace {
#include "kernels_impl.inc"
}  // namespace

const Kernels& kernelsV3() {
  static constexpr Kernels kTable = tableOf("x86-64-v3");
  return kTable;
}

}  // namespace pmeta
