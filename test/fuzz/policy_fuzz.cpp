#include <vector>

#include "fuzz_support.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/loaded_policy.h"
#include "targets.h"

namespace pmeta::fuzz {
namespace {

// most changes to a file contradict the length that it begins with: a text header that ends with a
// null byte gets the right one
std::string fileOf(std::string input) {
  if (input.empty() || input[0] != '{') return input;
  std::string header = cutBefore(input, std::string(1, '\0'));
  std::string length;
  for (int k = 0; k < 8; ++k) length += static_cast<char>(header.size() >> (8 * k) & 255);
  return length + header + input;
}

}  // namespace

void fuzzPolicy(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(fileOf(textOf(data, size)));
  try {
    LoadedPolicy policy(file.path(), 0);
    const std::vector<double> observation(policy.spec().observation_size);
    std::vector<double> action(policy.spec().action_size);
    policy.act(observation.data(), action.data());
    policy.description();
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
