#include "pmeta_core/experiment/experiment.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <new>
#include <stdexcept>
#include <tuple>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/hash.h"
#include "pmeta_core/env/model_files.h"
#include "pmeta_core/personal/dqn_personal_learner.h"
#include "pmeta_core/personal/sac_personal_learner.h"

namespace pmeta {
namespace {

constexpr char kModels[] = "models";  // in a run's folder

std::string formatUtc(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[40];
  std::strftime(text, sizeof text, format, &parts);
  return text;
}

std::string environmentVariable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

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

// the file without its presets, then the chosen preset
std::vector<YAML::Node> choosePreset(YAML::Node base, const std::string& source,
                                     const std::vector<std::string>& overrides) {
  const std::string chosen = peek({base}, overrides, "", "preset", "");
  const YAML::Node presets = base["presets"];
  // taken out in place: a clone would forget its line numbers
  base.remove("presets");
  // effective settings name the preset they came from, which is part of them already
  if (chosen.empty() || (!presets && peek({base}, {}, "", "preset", "") == chosen)) return {base};
  std::vector<std::string> known;
  if (presets && presets.IsMap()) {
    for (const auto& preset : presets) known.push_back(preset.first.Scalar());
    if (presets[chosen]) return {base, presets[chosen]};
  }
  throw Error("unknown preset '" + chosen + "': " + source +
              (known.empty() ? " has none." : " has " + join(known) + "."));
}

// nodes run in other working folders than the shell
std::string absolutePath(const std::string& setting, std::string path) {
  if (!isPlainText(path)) {
    throw Error(setting + " is " + shown(path) +
                " but must be a path in UTF-8, without control characters.");
  }
  if (path == "~" || path.rfind("~/", 0) == 0) {
    const std::string home = environmentVariable("HOME");
    if (home.empty()) {
      throw Error(setting + " is '" + path + "' but HOME is not set: give " + setting +
                  (setting == "results_dir" ? ":=DIR." : ":=FILE."));
    }
    path = home + path.substr(1);
  }
  return std::filesystem::absolute(path).lexically_normal().string();
}

const std::vector<std::string> kLearners = {"q_learning", "dqn", "sac"};

// six digits, so that a limit that is named is allowed
std::string roundedDown(double value) {
  const double scale = std::pow(10.0, 5 - std::floor(std::log10(value)));
  return formatNumber(std::floor(value * scale) / scale);
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
  const std::string key = firstDifference(saved.definingSettings(), experiment.definingSettings());
  if (!key.empty()) {
    throw Error(key + " cannot be changed in a run that goes on: resume " + dir.string() +
                " without it, or begin a new run.");
  }
  return experiment;
}

std::map<std::string, std::string> Experiment::definingSettings(const std::string& yaml) {
  std::map<std::string, std::string> settings = flatSettings(parseYaml(yaml, "config.yaml"));
  // of a model its hash counts, not where it is
  for (const char* key :
       {"results_dir", "pace", "publish_trajectories", "key_file", "checkpoint.interval",
        "aggregation.round_timeout", "environment.model_file"}) {
    settings.erase(key);
  }
  return settings;
}

std::string Experiment::settingsHash() const {
  std::string lines;
  for (const auto& [key, value] : definingSettings()) lines += key + "=" + value + "\n";
  return hashText(lines);
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

void Experiment::bind(Settings& s, const std::string& learner) {
  ExperimentSettings& e = settings_;
  s.bind("experiment", e.experiment, "name of the experiment set, and of its results folder");
  s.bind("preset", e.preset, "variant of the settings file; \"\" for none");
  s.bind("algorithm", e.algorithm, "what is trained",
         {"pmeta", "model_averaging", "independent", "pooled"});
  s.bind("learner", e.learner,
         "q_learning for tables, dqn for networks, sac for networks with continuous actions",
         kLearners);
  if (e.learner != "q_learning") {
    s.bind(
        "arithmetic", e.arithmetic,
        "matrix products of networks: native, with the instructions of this processor; portable, "
        "slower, with the same result on every processor that has AVX2 and FMA",
        {"native", "portable"});
  }
  s.bind("seed", e.seed, "one seed, one result", Range::atLeast(0));
  s.bind("rounds", e.rounds, "C: how often the meta-policy is aggregated", Range::between(1, 1e6));
  s.bind("updates_per_round", e.updates_per_round, "R: personalised and auxiliary updates a round",
         Range::between(1, 1e9));
  s.bind("evaluation_interval", e.evaluation_interval,
         "rounds from one evaluation of the policies to the next; the last is always evaluated",
         Range::between(1, 1e6));
  s.bind("results_dir", e.results_dir, "where run folders go; \"\" means ~/.ros/pmeta");
  s.bind("run_id", e.run_id, "name of the run; \"\" means start time, algorithm and seed");
  s.bind("pace", e.pace, "least seconds between rounds, to watch a fast experiment",
         Range::between(0, 3600));
  s.bind("publish_trajectories", e.publish_trajectories,
         "publish evaluation episodes for the viewer; false: no observation leaves an agent");
  s.bind("key_file", e.key_file,
         "over ROS: file with the key that messages are authenticated with (./pmeta key FILE); "
         "\"\" for none");
  s.bind("fresh_episodes", e.fresh_episodes,
         "local runner: after the last round, evaluate the last and the best policies again, on so "
         "many fresh episodes a task",
         Range::between(0, 1e6));

  s.bind("checkpoint.interval", e.checkpoint_interval,
         "rounds from one checkpoint of the whole run to the next; 0: none",
         Range::between(0, 1e6));

  s.bind("personal.alpha", e.personal.alpha, "personalised learning rate", Range::above(0));
  s.bind("personal.lambda", e.personal.lambda,
         "strength of the pull towards the auxiliary parameters", Range::atLeast(0));
  s.bind("personal.eta", e.personal.eta, "auxiliary learning rate", Range::atLeast(0));
  s.bind("personal.personal_init", e.personal.personal_init,
         "personal parameters at a round's start: the meta-policy's, or kept", {"meta", "keep"});

  bindLearner(s, learner);

  s.bind("aggregation.beta", e.aggregation.beta, "mixing: meta <- (1 - beta) meta + beta mean",
         Range::between(0, 1));
  s.bind("aggregation.quorum", e.aggregation.quorum,
         "updates that suffice once round_timeout has passed; 0 means all", Range::atLeast(0));
  s.bind("aggregation.round_timeout", e.aggregation.round_timeout,
         "seconds after which a round counts as late", Range::above(0));

  s.bind(
      "aggregation.catch_up", e.aggregation.catch_up,
      "how much more a task counts while the meta-policy lags behind its personal policy; 0: all "
      "tasks count the same",
      Range::between(0, 10));
  s.bind("aggregation.rule", e.aggregation.rule,
         "what becomes of each entry: the weighted mean of all values, their median, or the mean "
         "without those at both ends",
         {"mean", "median", "trimmed_mean"});
  s.bind("aggregation.trim", e.aggregation.trim,
         "rule trimmed_mean: share of the values that is cut at each end", Range::halfOpen(0, 0.5));
  s.bind("aggregation.max_update_norm", e.aggregation.max_update_norm,
         "an update further than this from the meta-policy it began with (Euclidean) is left out; "
         "0: none is",
         Range::atLeast(0));
  s.bind("aggregation.outlier_factor", e.aggregation.outlier_factor,
         "an update further than this times the median of the round's distances is left out, where "
         "there are three or more; 0: none is",
         Range::atLeast(0));

  s.bind("environment.name", e.environment, "family of environments", envFamilies().names());
  family_->bind(s);
}

void Experiment::bindLearner(Settings& s, const std::string& learner) {
  ExperimentSettings& e = settings_;
  if (learner == "q_learning") return pmeta::bind(s, "q_learning.", e.q_learning);
  s.bind("personal.learning_rate", e.personal.learning_rate, "Adam's learning rate",
         Range::above(0));
  s.bind("personal.proximal", e.personal.proximal,
         "the pull after Adam's step, or in the gradient that Adam gets", {"decoupled", "coupled"});
  if (learner == "dqn") pmeta::bind(s, "dqn.", e.dqn);
  if (learner != "sac") return;
  const Range own = Range::atLeast(-1);
  s.bind("personal.lambda_actor", e.personal.lambda_actor,
         "the actor's own strength; -1: lambda; 0: the actor is neither reset nor shared", own);
  s.bind("personal.lambda_critic", e.personal.lambda_critic, "the same for both critics", own);
  s.bind("personal.lambda_encoder", e.personal.lambda_encoder, "the same for the inference network",
         own);
  pmeta::bind(s, "sac.", e.sac);
}

void Experiment::anchorPaths(const std::string& folder) {
  namespace fs = std::filesystem;
  std::vector<std::string*> paths = {&settings_.results_dir, &settings_.key_file};
  if (ModelChoice* model = family_->model()) paths.push_back(&model->file);
  for (std::string* path : paths) {
    if (path->empty() || path->front() == '~') continue;
    *path = ((folder.empty() ? fs::current_path() : fs::path(folder)) / *path).string();
  }
}

Experiment Experiment::build(const YAML::Node& root, const std::string& source,
                             const std::vector<std::string>& overrides, const std::string& folder) {
  const std::vector<YAML::Node> files = choosePreset(root, source, overrides);
  Experiment experiment;
  const std::string learner = peek(files, overrides, "", "learner", experiment.settings_.learner);
  experiment.family_ = envFamilies().at(
      peek(files, overrides, "environment", "name", experiment.settings_.environment))();

  Settings settings;
  experiment.bind(settings, learner);
  for (const YAML::Node& file : files) settings.read(file, source);
  experiment.anchorPaths(folder);
  for (const std::string& assignment : overrides) settings.assign(assignment);
  experiment.anchorPaths("");

  ExperimentSettings& e = experiment.settings_;
  requirePlainName("experiment", e.experiment);
  if (!e.run_id.empty()) requirePlainName("run_id", e.run_id);
  ModelChoice* model = experiment.family_->model();
  const bool own_model = model != nullptr && !model->file.empty();
  if (own_model) model->file = absolutePath("environment.model_file", model->file);
  experiment.family_->build(static_cast<std::uint64_t>(e.seed));
  if (e.aggregation.quorum > experiment.numTasks()) {
    throw Error("aggregation.quorum is " + std::to_string(e.aggregation.quorum) +
                " but there are " + std::to_string(experiment.numTasks()) +
                " tasks: give at most that, or 0 for all.");
  }
  const std::vector<int>& counts = e.sac.context.exploration_episodes;
  if (std::adjacent_find(counts.begin(), counts.end(), std::greater_equal<int>()) != counts.end()) {
    throw Error("sac.exploration_episodes must be ascending, e.g. [5, 15].");
  }
  experiment.applyAlgorithm();
  experiment.checkAggregation();
  experiment.checkStability();
  e.dqn.portable = e.sac.portable = e.sac.context.portable = e.arithmetic == "portable";
  experiment.checkSampling();
  e.results_dir = expandResultsDir(e.results_dir);
  if (!e.key_file.empty()) e.key_file = absolutePath("key_file", e.key_file);
  if (e.run_id.empty()) {
    e.run_id = utcStamp() + "_" + e.algorithm + "_seed" + std::to_string(e.seed);
  }
  experiment.yaml_ = experiment.run_yaml_ = settings.yaml();
  if (own_model) {
    const std::string file = model->file;
    model->file = std::string(kModels) + "/" + ModelFiles::find(file).names.front();
    experiment.run_yaml_ = settings.yaml();
    model->file = file;
  }
  experiment.table_ = settings.table();
  return experiment;
}

void Experiment::copyModel() const {
  if (model() == nullptr || model()->file.empty()) return;
  const ModelFiles files = ModelFiles::find(model()->file);
  if (files.hash != model()->hash) {
    throw Error("the model " + model()->file + " has changed since it was read: start again.");
  }
  files.copyTo(runDir() + "/" + kModels);
}

std::string Experiment::describe() const {
  Experiment defaults;
  defaults.family_ = envFamilies().at(settings_.environment)();
  Settings settings;
  defaults.bind(settings, settings_.learner);
  settings.read(parseYaml(yaml_, "the settings"), "the settings");
  return settings.table(true);
}

void Experiment::applyAlgorithm() {
  ExperimentSettings& e = settings_;
  if (e.algorithm == "pmeta") return;
  if (e.algorithm == "pooled") {
    if (e.learner != "dqn") {
      throw Error("algorithm pooled needs learner dqn, which trains in several environments.");
    }
    if (e.dqn.num_envs < numTasks()) {
      throw Error("algorithm pooled needs at least one environment a task: set dqn.num_envs to " +
                  std::to_string(numTasks()) + " or more.");
    }
  }
  const std::string init = evaluatesMeta() ? "meta" : "keep";
  std::vector<std::string> changes;
  if (e.personal.lambda != 0) changes.push_back("personal.lambda to 0");
  if (e.personal.personal_init != init) changes.push_back("personal.personal_init to " + init);
  e.personal.lambda = 0;
  e.personal.lambda_actor = e.personal.lambda_critic = e.personal.lambda_encoder = -1;
  e.personal.personal_init = init;
  if (!evaluatesMeta()) {
    if (e.aggregation.beta != 0) changes.push_back("aggregation.beta to 0");
    e.aggregation.beta = 0;
  }
  if (!changes.empty())
    notes_.push_back("algorithm " + e.algorithm + " sets " + join(changes) + ".");
}

void Experiment::checkAggregation() const {
  const AggregationSettings& a = settings_.aggregation;
  if (a.rule != "mean" && a.catch_up > 0) {
    throw Error("aggregation.rule " + a.rule + " counts all tasks the same but " +
                "aggregation.catch_up is " + formatNumber(a.catch_up) +
                ": set catch_up to 0, or rule to mean.");
  }
  if (a.outlier_factor > 0 && a.outlier_factor < 1) {
    throw Error("aggregation.outlier_factor is " + formatNumber(a.outlier_factor) +
                " but must be at least 1, or 0 to leave none out.");
  }
}

void Experiment::checkSampling() const {
  const DqnSettings& dqn = settings_.dqn;
  if (settings_.learner != "dqn" || dqn.warm_up_steps >= dqn.n_step) return;
  throw Error("dqn.warm_up_steps is " + std::to_string(dqn.warm_up_steps) + " but dqn.n_step is " +
              std::to_string(dqn.n_step) + ": nothing could be sampled; give at least as many.");
}

void Experiment::checkStability() {
  const PersonalSettings& p = settings_.personal;
  for (const double lambda : {p.lambda_actor, p.lambda_critic, p.lambda_encoder}) {
    if (lambda < 0 && lambda != -1) {
      throw Error("a lambda of a network's own is " + formatNumber(lambda) +
                  " but must be at least 0, or -1 for that of all.");
    }
  }
  const bool tabular = settings_.learner == "q_learning";
  // with frozen auxiliary parameters the update is a linear map that blows up beyond these; of a
  // network only the pull is linear
  const double own = tabular ? 1 + settings_.q_learning.gamma : 0;
  const std::string formula = tabular ? "2 / (1 + lambda + gamma)" : "2 / lambda";
  if (p.alpha * (own + p.lambda) >= 2) {
    throw Error("personal.alpha = " + formatNumber(p.alpha) + " with personal.lambda = " +
                formatNumber(p.lambda) + " diverges: alpha must be below " + formula + " = " +
                roundedDown(2 / (own + p.lambda)) + ".");
  }
  if (p.eta * p.lambda >= 2) {
    throw Error("personal.eta = " + formatNumber(p.eta) +
                " with personal.lambda = " + formatNumber(p.lambda) +
                " diverges: eta must be below 2 / lambda = " + formatNumber(2 / p.lambda) + ".");
  }
  const double overshoot = p.alpha * ((tabular ? 1 : 0) + p.lambda);
  if (overshoot > 1) {
    notes_.push_back("warning: alpha * " + std::string(tabular ? "(1 + lambda)" : "lambda") +
                     " = " + formatNumber(overshoot) +
                     " is above 1: the personalised update overshoots.");
  }
  if (p.eta * p.lambda > 1) {
    notes_.push_back("warning: eta * lambda = " + formatNumber(p.eta * p.lambda) +
                     " is above 1: the auxiliary update overshoots.");
  }
}

int Experiment::numTestTasks() const {
  // a one-hot input has no place for a task that was not trained on
  const bool can_serve = settings_.learner != "sac" || settings_.sac.task_encoding != "one_hot";
  return evaluatesMeta() && can_serve ? family_->numTestTasks() : 0;
}

std::vector<int> Experiment::contextEpisodes() const {
  std::vector<int> counts = {0};
  if (settings_.learner != "sac" || settings_.sac.task_encoding != "inference") return counts;
  for (const int count : settings_.sac.context.exploration_episodes) counts.push_back(count);
  return counts;
}

int Experiment::quorum() const {
  return settings_.aggregation.quorum == 0 ? numTasks() : settings_.aggregation.quorum;
}

double Experiment::trim() const {
  const AggregationSettings& a = settings_.aggregation;
  if (a.rule == "mean") return 0;
  return a.rule == "median" ? 0.5 : a.trim;
}

std::unique_ptr<PersonalLearner> Experiment::makeLearner(int task) const {
  const auto refuse = [&]() -> Error {
    const auto settings = flatSettings(parseYaml(yaml_, "the settings"));
    std::vector<std::string> large;
    for (const char* name : {"buffer_size", "hidden", "num_envs", "batch_size"}) {
      const auto setting = settings.find(settings_.learner + "." + name);
      if (setting != settings.end()) large.push_back(setting->first + " = " + setting->second);
    }
    return Error("the learner of a task does not fit into this machine's memory: lower " +
                 join(large) + ".");
  };
  try {
    return makeLearnerUnguarded(task);
  } catch (const std::bad_alloc&) {
    throw refuse();
  } catch (const std::length_error&) {
    throw refuse();
  }
}

std::unique_ptr<PersonalLearner> Experiment::makeLearnerUnguarded(int task) const {
  const ExperimentSettings& e = settings_;
  if (e.learner != "q_learning") {
    ProximalAdamSettings optimizer;
    optimizer.learning_rate = e.personal.learning_rate;
    optimizer.alpha = e.personal.alpha;
    optimizer.lambda = e.personal.lambda;
    optimizer.eta = e.personal.eta;
    optimizer.coupled = e.personal.proximal == "coupled";
    const auto make_env = [family = family_, task] { return family->make(task); };
    if (e.learner == "dqn") {
      const auto updates = static_cast<std::int64_t>(e.rounds) * e.updates_per_round;
      if (e.algorithm != "pooled") {
        return std::make_unique<DqnPersonalLearner>(make_env, e.dqn, optimizer, updates);
      }
      const auto of_all_tasks = [family = family_](int k) {
        return family->make(k % family->numTasks());
      };
      return std::make_unique<DqnPersonalLearner>(make_env, e.dqn, optimizer, updates,
                                                  of_all_tasks);
    }
    const SacLambdas lambdas = {e.personal.lambda_actor, e.personal.lambda_critic,
                                e.personal.lambda_encoder};
    SacSettings sac = e.sac;
    // nothing is learnt on a test task: no replay
    if (isTestTask(task)) sac.buffer_size = sac.batch_size;
    // where nothing comes back the first meta-policy would explore for ever
    if (!evaluatesMeta()) sac.context.explorer = "personal";
    return std::make_unique<SacPersonalLearner>(make_env, sac, optimizer, task, numTasks(),
                                                lambdas);
  }
  std::unique_ptr<Env> env = family_->make(task);
  auto* tabular = dynamic_cast<TabularEnv*>(env.get());
  if (tabular == nullptr) {
    throw Error("environment '" + e.environment +
                "' is not tabular, so q_learning cannot learn it: choose learner:=dqn.");
  }
  env.release();
  return std::make_unique<TabularPersonalLearner>(std::unique_ptr<TabularEnv>(tabular),
                                                  e.q_learning, e.personal);
}

std::optional<double> Experiment::optimalReturn(int task) const {
  std::call_once(optima_->computed, [this] {
    for (int k = 0; k < totalTasks(); ++k) {
      const std::unique_ptr<Env> env = family_->make(k);
      const auto* tabular = dynamic_cast<const TabularEnv*>(env.get());
      optima_->returns.emplace_back();
      if (tabular != nullptr) optima_->returns.back() = pmeta::optimalReturn(*tabular).mean;
    }
  });
  return optima_->returns.at(static_cast<std::size_t>(task));
}

std::string Experiment::runDir() const {
  return settings_.results_dir + "/" + settings_.experiment + "/" + settings_.run_id;
}

std::string expandResultsDir(const std::string& results_dir) {
  std::string dir = results_dir;
  if (dir.empty()) {
    const std::string home = environmentVariable("HOME");
    const std::string ros_home = environmentVariable("ROS_HOME");
    if (ros_home.empty() && home.empty()) {
      throw Error("results_dir is not given and HOME is not set: give results_dir:=DIR.");
    }
    dir = (ros_home.empty() ? home + "/.ros" : ros_home) + "/pmeta";
  }
  return absolutePath("results_dir", dir);
}

void requireWritable(const std::string& dir) {
  const auto fail = [&](const std::string& why) {
    throw Error("the results folder " + dir + " cannot be written (" + why +
                "): choose another with results_dir:=DIR.");
  };
  std::error_code error;
  std::filesystem::create_directories(dir, error);
  if (error) fail(error.message());
  const std::string probe = dir + "/.write_probe_" + std::to_string(::getpid());
  errno = 0;
  std::ofstream file(probe);
  file << "probe\n";
  file.close();
  const std::string why = std::strerror(errno);
  const bool written = static_cast<bool>(file);
  std::filesystem::remove(probe, error);
  if (!written) fail(why);
}

std::string utcStamp() { return formatUtc("%Y%m%dT%H%M%S"); }
std::string utcTime() { return formatUtc("%Y-%m-%dT%H:%M:%SZ"); }

}  // namespace pmeta
