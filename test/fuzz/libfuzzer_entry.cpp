#include "targets.h"

// the entry point that libFuzzer looks for; PMETA_FUZZ_TARGET is one of targets.h
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pmeta::fuzz::PMETA_FUZZ_TARGET(data, size);
  return 0;
}
