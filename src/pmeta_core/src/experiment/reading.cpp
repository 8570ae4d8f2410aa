// From settings files, presets and overrides to an Experiment.
#include <algorithm>
#include <filesystem>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/library.h"
#include "pmeta_core/env/model_files.h"
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/experiment/results_dir.h"

namespace pmeta {
namespace {

// what the file or an override says of a setting that decides which others there are; `fallback` if
// neither does. The last one given counts; what is wrong with it is said when it is read in
// earnest.
std::string peek(const std::vector<YAML::Node>& files, const std::vector<std::string>& overrides,
                 const std::string& section, const std::string& name, std::string fallback) {
  for (const YAML::Node& file : files) {
    const YAML::Node group = section.empty() ? file : file[section];
    if (group && group.IsMap() && group[name] && group[name].IsScalar()) {
      fallback = group[name].Scalar();
    }
  }
  const std::string full = section.empty() ? name : section + "." + name;
  for (const std::string& assignment : overrides) {
    const auto split = assignment.find(":=");
    const std::string key = assignment.substr(0, split);
    if (split == std::string::npos || (key != full && key != name)) continue;
    try {
      const YAML::Node value = YAML::Load(assignment.substr(split + 2));
      if (value.IsScalar()) fallback = value.Scalar();
    } catch (const YAML::Exception&) {
      // Settings::assign says what is wrong with it
    }
  }
  return fallback;
}

// what files and overrides say of a group in which the user gives names, in their order
ListedSettings settingsOf(const std::string& group, const std::vector<YAML::Node>& files,
                          const std::vector<std::string>& overrides) {
  ListedSettings given;
  for (const YAML::Node& file : files) {
    if (!file.IsMap() || !file[group]) continue;
    if (!file[group].IsMap() || file[group].size() == 0) given.emplace_back(group, "");
    if (!file[group].IsMap()) continue;
    for (const auto& [key, value] : listedSettings(file[group])) {
      given.emplace_back(group + "." + key, value);
    }
  }
  for (const std::string& assignment : overrides) {
    const auto split = assignment.find(":=");
    if (split == std::string::npos || assignment.rfind(group + ".", 0) != 0) continue;
    given.emplace_back(assignment.substr(0, split), assignment.substr(split + 2));
  }
  return given;
}

// the group of that name, taken out in place: a clone would forget its line numbers
YAML::Node taken(YAML::Node& from, const std::string& name) {
  const YAML::Node group = from[name];
  from.remove(name);
  return group;
}

// appends what `presets` has of that name to `layers`, and all names that it has to `known`
void choose(const YAML::Node& presets, const std::string& name, std::vector<YAML::Node>& layers,
            std::vector<std::string>& known) {
  if (!presets || !presets.IsMap()) return;
  for (const auto& preset : presets) {
    if (std::find(known.begin(), known.end(), preset.first.Scalar()) == known.end()) {
      known.push_back(preset.first.Scalar());
    }
  }
  if (!name.empty() && presets[name]) layers.push_back(presets[name]);
}

// What a file says, each read over what is before it: the file, what it says of the algorithm, the
// chosen preset, and the algorithm's preset of that name.
std::vector<YAML::Node> layersOf(YAML::Node base, const std::string& source,
                                 const std::vector<std::string>& overrides) {
  const std::string preset = peek({base}, overrides, "", "preset", "");
  const YAML::Node presets = taken(base, "presets");
  const YAML::Node algorithms = taken(base, "algorithms");
  std::vector<YAML::Node> of_preset;
  std::vector<std::string> known;
  choose(presets, preset, of_preset, known);
  // only appended to: to assign to a node is to change what it stands for, here the file itself
  std::vector<YAML::Node> layers = {base};
  std::vector<YAML::Node> general = layers;
  general.insert(general.end(), of_preset.begin(), of_preset.end());
  const std::string algorithm =
      peek(general, overrides, "", "algorithm", ExperimentSettings().algorithm);
  if (algorithms && algorithms.IsMap() && algorithms[algorithm]) {
    YAML::Node own = algorithms[algorithm];
    choose(taken(own, "presets"), preset, of_preset, known);
    layers.push_back(own);
  }
  layers.insert(layers.end(), of_preset.begin(), of_preset.end());
  // effective settings name the preset they came from, which is part of them already
  const bool effective = !presets && peek({base}, {}, "", "preset", "") == preset;
  if (preset.empty() || !of_preset.empty() || effective) return layers;
  if (known.empty()) throw Error("unknown preset " + shown(preset) + ": " + source + " has none.");
  throw Error(unknownName("preset of " + source, preset, known));
}

void requireAlgorithms(const YAML::Node& of_algorithms) {
  if (!of_algorithms || !of_algorithms.IsMap()) return;
  for (const auto& algorithm : of_algorithms) algorithmNamed(algorithm.first.Scalar());
}

// a meta-learner has none of the agents' settings: what a file says of them is for the others
void removeAgentSettings(YAML::Node layer) {
  if (!layer.IsMap()) return;
  for (const char* name : {"learner", "personal", "fresh_episodes", "machines"}) {
    layer.remove(name);
  }
  for (const std::string& learner : learners().names()) layer.remove(learner);
  YAML::Node aggregation = layer["aggregation"];
  if (!aggregation.IsMap()) return;
  const YAML::Node timeout = aggregation["round_timeout"];
  layer.remove("aggregation");
  if (timeout) layer["aggregation"]["round_timeout"] = timeout;
}

// a relative path from a file of that folder; absolutePath() makes the rest of it
std::string anchored(const std::string& path, const std::string& folder) {
  if (path.empty() || path.front() == '~') return path;
  return (std::filesystem::path(folder) / path).string();
}

}  // namespace

Experiment Experiment::load(const std::string& path, const std::vector<std::string>& overrides) {
  namespace fs = std::filesystem;
  // of a pipe, as of <(...), the folder says nothing
  const bool is_file = fs::is_regular_file(path);
  return build(loadYamlFile(path), path, overrides,
               is_file ? fs::absolute(path).parent_path().string() : "");
}

Experiment Experiment::parse(const std::string& text, const std::string& source,
                             const std::vector<std::string>& overrides, const std::string& folder) {
  return build(parseYaml(text, source), source, overrides, folder);
}

Experiment Experiment::resume(const std::string& run_dir, const std::vector<std::string>& overrides,
                              const std::string& of_config) {
  namespace fs = std::filesystem;
  // the folder itself, whatever link leads to it
  const fs::path dir = (fs::weakly_canonical(run_dir) / "").lexically_normal().parent_path();
  const std::string config = (dir / "config.yaml").string();
  if (!fs::exists(config)) {
    throw Error("there is no run to resume in " + dir.string() + ": it has no config.yaml.");
  }
  // where the folder is now
  const std::string place = "results_dir:=" + dir.parent_path().parent_path().string();
  const Experiment saved = load(config, {place});
  if (fs::path(saved.runDir()).lexically_normal() != dir) {
    throw Error("the run folder " + dir.string() + " must be <results_dir>/" +
                saved.settings().experiment + "/" + saved.settings().run_id +
                ", as its config.yaml names it.");
  }
  const std::string name = saved.settings().experiment;
  if (!of_config.empty() && load(of_config).settings().experiment != name) {
    throw Error("the run in " + dir.string() + " is of experiment '" + name + "', not of " +
                of_config + ": give its own settings file.");
  }
  std::vector<std::string> changed = overrides;
  changed.push_back(place);
  Experiment experiment = load(config, changed);
  const std::string key =
      firstDifference(definingSettingsOf(dir.string()), experiment.definingSettings());
  if (!key.empty()) {
    throw Error(key + " cannot be changed in a run that goes on: resume " + dir.string() +
                " without it, or begin a new run.");
  }
  return experiment;
}

void Experiment::chooseKinds(const std::string& algorithm, const std::string& learner) {
  if (const MetaLearnerRow* row = metaLearners().find(algorithm)) {
    meta_learner_ = row->make();
  } else {
    learner_ = learners().at(learner).make();
  }
}

void Experiment::anchorPaths(const std::string& folder) {
  std::vector<std::string*> paths = {&settings_.results_dir, &settings_.key_file,
                                     &settings_.library};
  if (ModelChoice* model = family_->model()) paths.push_back(&model->file);
  for (std::string* path : paths) *path = anchored(*path, folder);
}

Experiment Experiment::build(const YAML::Node& root, const std::string& source,
                             const std::vector<std::string>& overrides, const std::string& folder) {
  const YAML::Node of_algorithms = root["algorithms"];  // stays, when it is taken out
  std::vector<YAML::Node> files = layersOf(root, source, overrides);
  // first, since it may bring what the settings name
  const std::string library =
      peek({}, overrides, "", "library", anchored(peek(files, {}, "", "library", ""), folder));
  if (!library.empty()) loadLibrary(absolutePath("library", library));
  requireAlgorithms(of_algorithms);
  Experiment experiment;
  experiment.chooseKinds(peek(files, overrides, "", "algorithm", experiment.settings_.algorithm),
                         peek(files, overrides, "", "learner", experiment.settings_.learner));
  experiment.family_ =
      makeFamily(peek(files, overrides, "environment", "name", experiment.settings_.environment));
  experiment.family_->outline(settingsOf("environment", files, overrides));
  if (experiment.hasMetaLearner()) {
    for (const YAML::Node& file : files) removeAgentSettings(file);
  } else {
    experiment.settings_.machines = outlineMachines(settingsOf("machines", files, overrides));
  }

  Settings settings;
  experiment.bind(settings);
  for (const YAML::Node& file : files) settings.read(file, source);
  experiment.anchorPaths(folder);
  for (const std::string& assignment : overrides) settings.assign(assignment);

  ExperimentSettings& e = experiment.settings_;
  requirePlainName("experiment", e.experiment);
  if (!e.run_id.empty()) requirePlainName("run_id", e.run_id);
  ModelChoice* model = experiment.family_->model();
  const bool own_model = model != nullptr && !model->file.empty();
  if (own_model) model->file = absolutePath("environment.model_file", model->file);
  experiment.family_->build(static_cast<std::uint64_t>(e.seed));
  if (e.aggregation.quorum > experiment.participants()) {
    throw Error("aggregation.quorum is " + std::to_string(e.aggregation.quorum) +
                " but there are " + std::to_string(experiment.numTasks()) +
                " tasks: give at most that, or 0 for all.");
  }
  experiment.algorithm_ = &algorithmNamed(e.algorithm);
  experiment.applyAlgorithm();
  experiment.checkAggregation();
  experiment.checkBodies();
  experiment.checkLearning();
  experiment.checkPackage();
  checkMachines(e.machines, experiment.totalTasks());
  e.results_dir = expandResultsDir(e.results_dir);
  if (!e.key_file.empty()) e.key_file = absolutePath("key_file", e.key_file);
  if (!e.library.empty()) e.library = absolutePath("library", e.library);
  if (e.run_id.empty()) {
    e.run_id = utcStamp() + "_" + e.algorithm + "_seed" + std::to_string(e.seed);
  }
  experiment.yaml_ = experiment.run_yaml_ = settings.yaml();
  if (own_model) {
    const std::string file = model->file;
    model->file = std::string(kModelsFolder) + "/" + ModelFiles::find(file).names.front();
    experiment.run_yaml_ = settings.yaml();
    model->file = file;
  }
  experiment.table_ = settings.table();
  return experiment;
}

}  // namespace pmeta
