#include "pmeta_core/nn/machine.h"

#include <gnu/libc-version.h>

#include <fstream>

#include "pmeta_core/nn/gemm.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

// "" where the system does not say
std::string processorModel() {
  std::ifstream file("/proc/cpuinfo");
  const std::string key = "model name";
  for (std::string line; std::getline(file, line);) {
    const auto colon = line.find(": ");
    if (line.rfind(key, 0) == 0 && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "";
}

}  // namespace

std::map<std::string, std::string> machine() {
  return {{"processor", processorModel()},
          {"products", gemmName()},
          {"kernels", kernels().name},
          {"glibc", gnu_get_libc_version()}};
}

}  // namespace pmeta
