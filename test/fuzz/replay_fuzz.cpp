#include "fuzz_support.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/verify/model_check.h"
#include "pmeta_core/verify/trajectory_check.h"
#include "pmeta_core/verify/trajectory_simulator.h"
#include "targets.h"

namespace pmeta::fuzz {
namespace {

constexpr char kGoals[] = "task,goal_x,goal_y\n0,1,0\n1,-0.5,0.8\n";

void replay(const std::string& kind, const std::string& path) {
  const std::string tasks_of = "tasks of ";
  if (kind.rfind(tasks_of, 0) == 0) {
    makeTrajectorySimulator(kind.substr(tasks_of.size()), path);
  } else if (isModelKind(kind)) {
    modelTable(checkModel(kind, path));
  } else {
    const MemoryFile goals(kGoals);
    trajectoryTable(checkTrajectories(kind, path, kind == "sparse_point" ? goals.path() : ""));
  }
}

}  // namespace

// a line that says the kind, or "tasks of KIND", then the file, plain or compressed
void fuzzReplay(const std::uint8_t* data, std::size_t size) {
  std::string content = textOf(data, size);
  const std::string kind = cutBefore(content, "\n");
  const MemoryFile file(content);
  try {
    replay(kind, file.path());
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
