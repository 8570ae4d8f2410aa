#include "kernel_tables.h"

namespace pmeta {
namespace {
#include "kernels_impl.inc"
}  // namespace

const Kernels& kernelsV4() {
  static constexpr Kernels kTable = tableOf("x86-64-v4");
  return kTable;
}

}  // namespace pmeta
