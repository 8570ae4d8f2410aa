#include <vector>

#include "fuzz_support.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/experiment.h"
#include "targets.h"

namespace pmeta::fuzz {

// a settings file, then overrides, one a line, behind a line of "%%"
void fuzzSettings(const std::uint8_t* data, std::size_t size) {
  std::string rest = textOf(data, size);
  const std::string text = cutBefore(rest, "\n%%\n");
  std::vector<std::string> overrides;
  while (!rest.empty()) overrides.push_back(cutBefore(rest, "\n"));
  std::string effective;
  try {
    effective = Experiment::parse(text, "fuzz.yaml", overrides).yaml();
  } catch (const Error&) {
    return;
  }
  // an Error here is a finding
  require(Experiment::parse(effective, "effective.yaml").yaml() == effective,
          "effective settings read as others");
}

}  // namespace pmeta::fuzz
