// The algorithms that come with the suite.
#include <map>

#include "pmeta_core/base/error.h"
#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/experiment/algorithm.h"

namespace pmeta {

Registry<Algorithm>& algorithms() {
  static Registry<Algorithm> algorithms("algorithm");
  return algorithms;
}

std::vector<std::string> algorithmNames() {
  std::vector<std::string> names = algorithms().names();
  const std::vector<std::string> more = metaLearners().names();
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

const Algorithm& algorithmNamed(const std::string& name) {
  if (const Algorithm* algorithm = algorithms().find(name)) return *algorithm;
  static std::map<std::string, Algorithm> of_meta_learners;
  if (const MetaLearnerRow* row = metaLearners().find(name)) {
    Algorithm& algorithm = of_meta_learners[name];
    algorithm.label = row->label;
    algorithm.meaning = row->meaning;
    return algorithm;
  }
  throw Error(unknownName("algorithm", name, algorithmNames()));
}

namespace {

using Row = Registered<Algorithm>;

Algorithm pmeta() {
  Algorithm row;
  row.label = "pMeta-RL";
  row.meaning = "personal policies, pulled towards auxiliary parameters, which are aggregated";
  row.sent = Sent::kAuxiliary;
  row.pulls = true;
  return row;
}

Algorithm modelAveraging() {
  Algorithm row;
  row.label = "model averaging";
  row.meaning = "the personal parameters themselves are aggregated";
  return row;
}

// Li et al., "Federated Optimization in Heterogeneous Networks", 2020, with the pull as pMeta has
// it
Algorithm fedProx() {
  Algorithm row;
  row.label = "FedProx";
  row.meaning = "personal parameters, pulled towards the round's meta-policy, are aggregated";
  row.pulls = true;
  row.fixed_anchor = true;
  return row;
}

Algorithm independent() {
  Algorithm row;
  row.label = "independent";
  row.meaning = "each robot for itself";
  row.shares = false;
  return row;
}

Algorithm pooled() {
  Algorithm row;
  row.label = "pooled";
  row.meaning = "each robot for itself, in environments of all tasks";
  row.shares = false;
  row.pools_environments = true;
  row.check = [](const ExperimentSettings& settings, const LearnerKind& learner, int num_tasks) {
    if (learner.trainingEnvs() == 0) {
      throw Error("algorithm pooled needs a learner that trains in several environments; " +
                  settings.learner + " does not.");
    }
    if (learner.trainingEnvs() < num_tasks) {
      throw Error("algorithm pooled needs at least one environment a task: set " +
                  settings.learner + ".num_envs to " + std::to_string(num_tasks) + " or more.");
    }
  };
  return row;
}

const Row kPmeta(algorithms(), "pmeta", pmeta());
const Row kModelAveraging(algorithms(), "model_averaging", modelAveraging());
const Row kFedProx(algorithms(), "fedprox", fedProx());
const Row kIndependent(algorithms(), "independent", independent());
const Row kPooled(algorithms(), "pooled", pooled());

}  // namespace
}  // namespace pmeta
