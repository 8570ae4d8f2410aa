#include "pmeta_core/verify/trajectory_simulator.h"

#include <map>

#include "env_simulator.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/verify/model_check.h"

namespace pmeta {
namespace {

using Factory = std::unique_ptr<TrajectorySimulator> (*)(const std::string& tasks_file);

// every kind of trajectory file; a new one adds its line here
const std::map<std::string, Factory>& kinds() {
  static const std::map<std::string, Factory> kKinds = {
      {"ant", makeAntSimulator},
      {"cartpole", makeCartPoleSimulator},
      {"half_cheetah", makeHalfCheetahSimulator},
      {"mountaincar", makeMountainCarSimulator},
      {"sparse_point", makeSparsePointSimulator},
      {"walker2d", makeWalker2dSimulator},
      {"walker2d_params", makeWalker2dParamsSimulator},
  };
  return kKinds;
}

}  // namespace

std::vector<std::string> trajectoryKinds() {
  std::vector<std::string> names;
  for (const auto& kind : kinds()) names.push_back(kind.first);
  return names;
}

std::unique_ptr<TrajectorySimulator> makeTrajectorySimulator(const std::string& kind,
                                                             const std::string& tasks_file) {
  const auto found = kinds().find(kind);
  if (found == kinds().end()) {
    throw Error(unknownName("trajectories", kind, concatenated({trajectoryKinds(), modelKinds()})));
  }
  return found->second(tasks_file);
}

}  // namespace pmeta
