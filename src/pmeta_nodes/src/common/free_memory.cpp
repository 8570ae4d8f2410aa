#include "common/free_memory.h"

#include <malloc.h>

namespace pmeta_nodes {
namespace {

constexpr int kMegabyte = 1 << 20;

}  // namespace

void boundFreeMemory() {
  mallopt(M_MMAP_THRESHOLD, kMegabyte);
  // setting any threshold fixes the others where they are: this one at 128 kB
  mallopt(M_TRIM_THRESHOLD, 8 * kMegabyte);
  mallopt(M_TOP_PAD, kMegabyte);
}

}  // namespace pmeta_nodes
