#include "pmeta_core/run/loaded_policy.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <locale>
#include <sstream>
#include <vector>

#include "pmeta_core/act/evaluation.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

const std::string& textOf(const PolicyFile& file, const std::string& path, const std::string& key) {
  const auto it = file.metadata.find(key);
  if (it == file.metadata.end())
    throw Error("the policy file " + path + " does not say its " + key + ".");
  return it->second;
}

int numberOf(const PolicyFile& file, const std::string& path, const std::string& key, int limit) {
  const std::string& text = textOf(file, path, key);
  int value = -1;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || result.ptr != text.data() + text.size() || value < 0 ||
      value > limit) {
    throw Error("the policy file " + path + " has a " + key +
                " that is no whole number from 0 to " + std::to_string(limit) + ".");
  }
  return value;
}

// A model that is not shipped is the copy in the run's folder, or, of a policy that is elsewhere,
// the file that was copied; its hash says whether it is the right one.
Experiment experimentOf(const PolicyFile& file, const std::string& path) {
  namespace fs = std::filesystem;
  const std::string source = "the policy file " + path;
  const std::string& settings = textOf(file, path, "settings");
  const fs::path run = fs::absolute(path).lexically_normal().parent_path().parent_path();
  const auto original = file.metadata.find("model_file");
  const YAML::Node environment = parseYaml(settings, source)["environment"];
  if (original == file.metadata.end() || !environment || !environment["model_file"]) {
    return Experiment::parse(settings, source, {}, run.string());
  }
  const fs::path copy = run / environment["model_file"].as<std::string>();
  if (fs::exists(copy)) return Experiment::parse(settings, source, {}, run.string());
  if (!fs::exists(original->second)) {
    throw Error(source + " needs its model, which is neither " + copy.string() + " nor " +
                original->second + ": leave the policy in the folder of its run.");
  }
  YAML::Emitter value;
  value << YAML::DoubleQuoted << original->second;
  return Experiment::parse(settings, source,
                           {std::string("environment.model_file:=") + value.c_str()});
}

}  // namespace

LoadedPolicy::LoadedPolicy(const std::string& path, int as_task)
    : LoadedPolicy(path, loadPolicy(path), as_task) {}

LoadedPolicy::LoadedPolicy(const std::string& path, PolicyFile file, int as_task)
    : experiment_(experimentOf(file, path)), model_(std::move(file.model)) {
  round_ = numberOf(file, path, "round", experiment_.settings().rounds);
  const std::string& policy = textOf(file, path, "policy");
  if (policy == name(PolicyKind::kPersonal)) {
    policy_ = PolicyKind::kPersonal;
    task_ = numberOf(file, path, "task", experiment_.numTasks() - 1);
  } else if (policy != name(PolicyKind::kMeta)) {
    throw Error("the policy file " + path + " is of neither a personal nor a meta policy.");
  }
  env_ = experiment_.family().make(std::max(task_, 0));
  // the layout that the settings give is known before anything of its size is allocated
  policies_ = experiment_.policies(*env_);
  if (model_.layout != policies_->layout()) {
    throw Error("the policy file " + path + " has parameters that do not fit its own settings.");
  }
  task_input_ = readTaskInput(file, path, as_task);
  actor_ = policies_->actor(model_, task_input_, 1);
  told_ = as_task >= 0;
  observation_.resize(static_cast<std::size_t>(spec().observation_size));
  next_observation_ = observation_;
  action_.resize(static_cast<std::size_t>(spec().action_size));
}

std::vector<float> LoadedPolicy::readTaskInput(const PolicyFile& file, const std::string& path,
                                               int as_task) const {
  if (policy_ == PolicyKind::kMeta) {
    const auto input = experiment_.metaInput(as_task);
    if (input) return *input;
    throw Error("the policy file " + path +
                " is a meta-policy that must be told its task: choose one from 0 to " +
                std::to_string(experiment_.numTasks() - 1) + ".");
  }
  const std::size_t size = policies_->taskInputSize();
  if (size == 0) return {};
  std::istringstream text(textOf(file, path, "task_input"));
  std::vector<float> numbers;
  for (std::string word; std::getline(text, word, ',');) {
    std::istringstream number(word);
    number.imbue(std::locale::classic());
    float value = 0;
    number >> value;
    if (!number || !number.eof() || !std::isfinite(value)) break;
    numbers.push_back(value);
  }
  if (numbers.size() != size) {
    throw Error("the policy file " + path + " has a task_input that is not of " +
                std::to_string(size) + " numbers.");
  }
  return numbers;
}

std::string LoadedPolicy::description() const {
  const std::string whose = task_ < 0
                                ? "meta-policy of " + experiment_.settings().experiment
                                : "personal policy of " + experiment_.family().taskName(task_);
  return whose + ", round " + std::to_string(round_) + " of run " + experiment_.settings().run_id;
}

Episode LoadedPolicy::record() {
  const int task = std::max(task_, 0);
  Evaluation evaluation(makeEnvs([&](int) { return experiment_.family().make(task); }, 1));
  Rng rng(static_cast<std::uint64_t>(experiment_.settings().seed), task, Stream::kEvaluate);
  return evaluation.record(*actor_, rng);
}

bool LoadedPolicy::explore(std::uint64_t seed) {
  if (policy_ != PolicyKind::kMeta || told_) return false;
  std::unique_ptr<Adaptation> adaptation = experiment_.adaptation(*policies_, model_);
  if (!adaptation) return false;
  adaptation_ = std::move(adaptation);
  adapted_.reset();
  exploration_episodes_ = experiment_.contextEpisodes().back();
  episode_ = 0;
  rng_ = Rng(seed, 0, Stream::kEvaluate);
  return true;
}

void LoadedPolicy::beginEpisode() {
  if (!adaptation_) return;
  if (exploring() && episode_ > 0) adaptation_->episodeOver();
  if (exploring() && episode_ >= exploration_episodes_) adapted_ = adaptation_->adapted(1);
  ++episode_;
  if (exploring()) adaptation_->beginEpisode(rng_);
  acting().begin(0, rng_);
}

bool LoadedPolicy::observe(double reward, const double* next_observation) {
  if (!adaptation_ || !std::isfinite(reward) || !take(next_observation, next_observation_)) {
    return false;
  }
  Step step;
  step.reward = reward;
  acting().observe({0, observation_.data(), action_.data(), step, next_observation_.data()});
  return true;
}

Actor& LoadedPolicy::acting() {
  if (adapted_) return *adapted_;
  return adaptation_ ? static_cast<Actor&>(*adaptation_) : *actor_;
}

bool LoadedPolicy::take(const double* numbers, std::vector<float>& observation) const {
  for (std::size_t k = 0; k < observation.size(); ++k) {
    observation[k] = static_cast<float>(numbers[k]);
    if (!std::isfinite(observation[k])) return false;
  }
  return true;
}

bool LoadedPolicy::act(const double* observation, double* action) {
  if (!take(observation, observation_)) return false;
  if (adaptation_ && episode_ == 0) beginEpisode();
  acting().look(observation_.data(), envs_);
  if (!acting().act(0, rng_, action)) return false;
  std::copy_n(action, action_.size(), action_.begin());
  return true;
}

}  // namespace pmeta
