#pragma once

#include "pmeta_core/nn/kernels.h"

namespace pmeta {

// one table for each instruction set; the last two may run only where the processor has theirs
__attribute__((visibility("hidden"))) const Kernels& kernelsDefault();
__attribute__((visibility("hidden"))) const Kernels& kernelsV3();
__attribute__((visibility("hidden"))) const Kernels& kernelsV4();

}  // namespace pmeta
