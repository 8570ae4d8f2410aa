#include "pmeta_core/experiment/experiment.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/hash.h"
#include "pmeta_core/env/model_files.h"

namespace pmeta {

Experiment::Experiment() {
  for (const std::string& name : aggregationRules().names()) {
    rules_[name] = aggregationRules().at(name)();
  }
}

std::map<std::string, std::string> Experiment::definingSettings(const std::string& yaml) {
  std::map<std::string, std::string> settings = flatSettings(parseYaml(yaml, "config.yaml"));
  // of a model its hash counts, not where it is
  for (const char* key :
       {"results_dir", "pace", "publish_trajectories", "key_file", "checkpoint.interval",
        "aggregation.round_timeout", "environment.model_file", "environment.timeout",
        "environment.reset_timeout", "environment.retries", "environment.patience", "library",
        "threads"}) {
    settings.erase(key);
  }
  // where agents run, in one group
  settings.erase(settings.lower_bound("machines."), settings.lower_bound("machines/"));
  return settings;
}

std::map<std::string, std::string> Experiment::definingSettingsOf(const std::string& run_dir) {
  const std::string path = run_dir + "/manifest.json";
  const auto manifest = std::filesystem::exists(path)
                            ? nlohmann::json::parse(readFile(path, "the manifest"), nullptr, false)
                            : nlohmann::json::object();
  // what there was no setting of then has its default
  std::map<std::string, std::string> read = load(run_dir + "/config.yaml").definingSettings();
  if (!manifest.is_object() || !manifest.contains("defining_settings")) return read;
  const nlohmann::json& settings = manifest["defining_settings"];
  const auto is_text = [](const nlohmann::json& value) { return value.is_string(); };
  if (!settings.is_object() || !std::all_of(settings.begin(), settings.end(), is_text)) {
    throw Error(path + " must hold a text for each of its defining_settings: it has been altered.");
  }
  auto recorded = settings.get<std::map<std::string, std::string>>();
  recorded.merge(read);
  return recorded;
}

std::string Experiment::settingsHash() const {
  std::string lines;
  for (const auto& [key, value] : definingSettings()) lines += key + "=" + value + "\n";
  return hashText(lines);
}

void Experiment::copyModel() const {
  if (model() == nullptr || model()->file.empty()) return;
  const ModelFiles files = ModelFiles::find(model()->file);
  if (files.hash != model()->hash) {
    throw Error("the model " + model()->file + " has changed since it was read: start again.");
  }
  files.copyTo(runDir() + "/" + kModelsFolder);
}

std::string Experiment::describe() const {
  Experiment defaults;
  defaults.family_ = makeFamily(settings_.environment);
  const YAML::Node effective = parseYaml(yaml_, "the settings");
  defaults.family_->outline(listedSettings(effective));
  defaults.settings_.machines = outlineMachines(listedSettings(effective));
  Settings settings;
  defaults.chooseKinds(settings_.algorithm, settings_.learner);
  defaults.bind(settings);
  settings.read(effective, "the settings");
  return settings.table(true);
}

int Experiment::quorum() const {
  return settings_.aggregation.quorum == 0 ? participants() : settings_.aggregation.quorum;
}

std::string Experiment::runDir() const {
  return settings_.results_dir + "/" + settings_.experiment + "/" + settings_.run_id;
}

std::string firstDifference(const std::map<std::string, std::string>& a,
                            const std::map<std::string, std::string>& b) {
  for (const auto& [one, other] : {std::tie(a, b), std::tie(b, a)}) {
    for (const auto& [key, value] : one) {
      const auto found = other.find(key);
      if (found == other.end() || found->second != value) return key;
    }
  }
  return "";
}

}  // namespace pmeta
