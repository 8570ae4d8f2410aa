#include "pmeta_core/storage/manifest.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/nn/machine.h"
#include "pmeta_core/storage/origin.h"
#include "pmeta_core/storage/run_lock.h"

namespace pmeta {
namespace {

using Json = nlohmann::ordered_json;

const std::vector<std::string> kPull = {"personal.lambda",        "personal.lambda_actor",
                                        "personal.lambda_critic", "personal.lambda_encoder",
                                        "personal.eta",           "personal.personal_init",
                                        "personal.proximal"};

// null where there is none
Json entryOf(const std::string& run_dir, const char* key) {
  const std::string path = run_dir + "/manifest.json";
  if (!std::filesystem::exists(path)) return {};
  Json manifest = Json::parse(readFile(path, "the manifest"), nullptr, false);
  if (!manifest.is_object() || !manifest.contains(key)) return {};
  return std::move(manifest[key]);
}

std::vector<std::string> fixedSettings(const Experiment& experiment, const Algorithm& algorithm) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : experiment.definingSettings()) {
    const bool pull = std::find(kPull.begin(), kPull.end(), key) != kPull.end();
    const bool without_use =
        pull ? !algorithm.pulls || (algorithm.fixed_anchor && key == "personal.eta")
             : !algorithm.shares && key.rfind("aggregation.", 0) == 0;
    if (without_use) keys.push_back(key);
  }
  return keys;
}

Json curves(const Experiment& experiment) {
  Json found = Json::array();
  const auto add = [&](PolicyKind policy, Split split, int context_episodes) {
    found.push_back(
        {{"policy", name(policy)}, {"split", name(split)}, {"context_episodes", context_episodes}});
  };
  if (!experiment.hasMetaLearner()) add(PolicyKind::kPersonal, Split::kTrain, 0);
  if (!experiment.evaluatesMeta()) return found;
  for (const Split split : {Split::kTrain, Split::kTest}) {
    if (split == Split::kTest && experiment.numTestTasks() == 0) continue;
    for (const int count : experiment.contextEpisodes()) add(PolicyKind::kMeta, split, count);
  }
  return found;
}

// pmeta, averaging, independent, pooled, a fixed anchor; then meta-learners by name
int orderOf(const Experiment& experiment) {
  const Algorithm& algorithm = experiment.algorithm();
  if (algorithm.fixed_anchor) return 4;
  if (!experiment.hasMetaLearner()) {
    return !algorithm.pulls + !algorithm.shares + algorithm.pools_environments;
  }
  const std::vector<std::string> names = metaLearners().names();
  const auto found = std::find(names.begin(), names.end(), experiment.settings().algorithm);
  return 5 + static_cast<int>(found - names.begin());
}

Json figures(const Experiment& experiment) {
  const Algorithm& algorithm = experiment.algorithm();
  const bool at_once = experiment.hasMetaLearner();
  const bool averages = algorithm.shares && !algorithm.pulls && !at_once;
  Json found;
  found["label"] = algorithm.label;
  found["order"] = orderOf(experiment);
  found["baseline"] = !algorithm.pulls || algorithm.fixed_anchor;
  found["reference_line"] = averages;
  found["compared_by"] = name(averages || at_once ? PolicyKind::kMeta : PolicyKind::kPersonal);
  found["own_settings"] = algorithm.pulls ? kPull : std::vector<std::string>();
  found["fixed_settings"] = fixedSettings(experiment, algorithm);
  found["policies"] = experiment.policyFiles();
  found["curves"] = curves(experiment);
  return found;
}

}  // namespace

std::string constantManifest(const Experiment& experiment, const std::string& started) {
  const ExperimentSettings& e = experiment.settings();
  Json manifest;
  manifest["experiment"] = e.experiment;
  manifest["run_id"] = e.run_id;
  manifest["algorithm"] = e.algorithm;
  manifest["seed"] = e.seed;
  manifest["status"] = nullptr;
  manifest["reason"] = nullptr;
  manifest["rounds_done"] = nullptr;
  manifest["rounds"] = e.rounds;
  manifest["broken_episodes"] = nullptr;
  manifest["started"] = started;
  manifest["ended"] = nullptr;
  manifest["host"] = hostName();
  manifest["pid"] = ::getpid();
  manifest["defining_settings"] = experiment.definingSettings();
  manifest["settings_hash"] = experiment.settingsHash();
  if (experiment.model() != nullptr) manifest["model_hash"] = experiment.model()->hash;
  if (const Package& package = experiment.family().package(); !package.name.empty()) {
    manifest["package"] = package.name + " " + package.version;
  }
  manifest["figures"] = figures(experiment);
  manifest["commit"] = commit();
  manifest["versions"] = versions();
  manifest["machine"] = machine();
  manifest["tasks"] = Json::array();
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    const Split split = experiment.isTestTask(task) ? Split::kTest : Split::kTrain;
    Json entry = {{"task", task},
                  {"split", name(split)},
                  {"name", experiment.family().taskName(task)},
                  {"description", experiment.family().taskDescription(task)}};
    if (const auto optimum = experiment.optimalReturn(task)) entry["optimal_return"] = *optimum;
    manifest["tasks"].push_back(std::move(entry));
  }
  return manifest.dump();
}

std::string manifestText(const std::string& run_dir, const char* key) {
  const Json entry = entryOf(run_dir, key);
  return entry.is_string() ? entry.get<std::string>() : "";
}

std::int64_t manifestCount(const std::string& run_dir, const char* key) {
  const Json entry = entryOf(run_dir, key);
  return entry.is_number_integer() ? entry.get<std::int64_t>() : 0;
}

std::string otherMachine(const Experiment& experiment) {
  const Json before = entryOf(experiment.runDir(), "machine");
  if (!before.is_object()) return "";
  std::map<std::string, std::string> parts;
  for (const auto& [part, value] : before.items()) {
    parts[part] = value.is_string() ? value.get<std::string>() : "";
  }
  const std::string part = differingPart(experiment, parts);
  if (part.empty()) return "";
  return "the run was begun on another machine (" + part +
         "): its numbers may differ from those of a run that stays on one.";
}

}  // namespace pmeta
