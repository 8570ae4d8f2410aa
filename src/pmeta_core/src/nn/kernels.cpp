#include "pmeta_core/nn/kernels.h"

#include <atomic>

#include "kernel_tables.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

// what this processor and its operating system can run, fastest first
std::vector<const Kernels*> runnable() {
  std::vector<const Kernels*> tables;
#ifdef __x86_64__
  __builtin_cpu_init();
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                  __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512vl");
  if (v4) tables.push_back(&kernelsV4());
  if (v3) tables.push_back(&kernelsV3());
#endif
  tables.push_back(&kernelsDefault());
  return tables;
}

std::atomic<const Kernels*>& chosen() {
  static std::atomic<const Kernels*> table{runnable().front()};
  return table;
}

}  // namespace

const Kernels& kernels() { return *chosen().load(std::memory_order_relaxed); }

std::vector<std::string> kernelNames() {
  std::vector<std::string> names;
  for (const Kernels* table : runnable()) names.push_back(table->name);
  return names;
}

void setKernels(const std::string& name) {
  std::string known;
  for (const Kernels* table : runnable()) {
    if (name == table->name) {
      chosen() = table;
      return;
    }
    known += (known.empty() ? "" : ", ") + std::string(table->name);
  }
  throw Error("there are no kernels '" + name + "' on this machine; it has " + known + ".");
}

}  // namespace pmeta
