// compare_run: may this machine's agents take part in a run that was launched on another?
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/origin.h"

namespace {

using pmeta::Error;
using pmeta::Experiment;

constexpr char kHelp[] =
    R"(compare_run: compares this machine with the one where a run was launched.

  rosrun pmeta_nodes compare_run [key:=value ...] < ORIGIN_AND_SETTINGS

Reads the run's parameter `origin`, a line, and after it its parameter `config`. results_dir:=DIR and
key_file:=FILE are those of this machine, where it has its own.
Exits with 1 and one sentence if its agents cannot take part: another version, other settings (of a
robot's model the file counts), no key. Warns of another commit or kind of processor, and where
nothing can be kept.
)";

int compare(const std::vector<std::string>& places) {
  std::string origin;
  std::getline(std::cin, origin);
  const std::string settings{std::istreambuf_iterator<char>(std::cin), {}};
  const Experiment experiment = Experiment::parse(settings, "the run's settings", places);
  const pmeta::OriginDifference difference = pmeta::differenceFrom(origin, experiment);
  if (!difference.refusal.empty()) throw Error(difference.refusal);
  const pmeta::Authenticator probe(experiment.settings().key_file);
  for (const std::string& warning : difference.warnings) {
    std::cerr << "pmeta: warning: " << warning << "\n";
  }
  try {
    pmeta::requireWritable(experiment.settings().results_dir + "/" +
                           experiment.settings().experiment);
  } catch (const Error& error) {
    std::cerr << "pmeta: warning: checkpoints and personal policies will not be kept: "
              << error.what() << "\n";
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  pmeta::prepareProcess();
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && (words.front() == "--help" || words.front() == "-h")) {
    std::cout << kHelp;
    return 0;
  }
  try {
    return compare(words);
  } catch (const std::exception& error) {
    std::cerr << "pmeta: " << error.what() << std::endl;
    return 1;
  }
}
