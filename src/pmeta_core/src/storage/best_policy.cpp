#include "pmeta_core/storage/best_policy.h"

#include <filesystem>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/number.h"

namespace pmeta {
namespace {

double returnOf(const std::string& path) {
  const PolicyFile file = loadPolicy(path);
  const auto found = file.metadata.find("return");
  double mean = 0;
  if (found == file.metadata.end() || !parseNumber(found->second, mean)) {
    throw Error("the best policy so far, " + path +
                ", does not say what its return was: move it out of the way.");
  }
  return mean;
}

}  // namespace

void BestPolicy::offer(const Experiment& experiment, const PolicyOrigin& origin,
                       const Model& model) {
  if (!looked_) {
    const std::string path =
        policyPath(experiment.runDir(), Kept::kBest, origin.policy, origin.task);
    if (std::filesystem::exists(path)) best_ = returnOf(path);
    looked_ = true;
  }
  const double mean = origin.mean_return.value();
  if (best_ && mean <= *best_) return;
  saveRunPolicy(experiment, Kept::kBest, origin, model);
  best_ = mean;
}

}  // namespace pmeta
