#include "kernel_tables.h"

namespace pmeta {
namespace {
#include "kernels_impl.inc"
}  // namespace

const Kernels& kernelsDefault() {
  static constexpr Kernels kTable = tableOf("default");
  return kTable;
}

}  // namespace pmeta
