#include "pmeta_core/run/loaded_policy.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <locale>
#include <optional>
#include <sstream>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/sac_networks.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/mlp.h"

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

/// Networks that act on an observation as floats.
class LoadedPolicy::Network {
 public:
  virtual ~Network() = default;
  virtual std::vector<Block> blocks() const = 0;
  virtual void act(const float* parameters, const float* observation, double* action) = 0;

  bool actOn(const double* observation, double* action) {
    for (std::size_t k = 0; k < observation_.size(); ++k) {
      observation_[k] = static_cast<float>(observation[k]);
      if (!std::isfinite(observation_[k])) return false;
    }
    act(parameters_.data(), observation_.data(), action);
    return true;
  }

  void load(const std::vector<float>& values, std::size_t observation_size) {
    parameters_.assign(values.begin(), values.end());
    observation_.resize(observation_size);
  }

 private:
  AlignedFloats parameters_;
  std::vector<float> observation_;
};

class LoadedPolicy::QNetwork : public Network {
 public:
  explicit QNetwork(MlpSpec spec) : mlp_(std::move(spec)) {}
  std::vector<Block> blocks() const override { return mlp_.blocks(); }
  void act(const float* parameters, const float* observation, double* action) override {
    // only now are its sizes known to be those of the file
    if (!workspace_) workspace_.emplace(mlp_, 1);
    const float* values = mlp_.forward(parameters, observation, 1, *workspace_);
    action[0] = static_cast<double>(std::max_element(values, values + mlp_.outputs()) - values);
  }

 private:
  Mlp mlp_;
  std::optional<MlpWorkspace> workspace_;
};

class LoadedPolicy::Actor : public Network {
 public:
  Actor(const EnvSpec& spec, const SacSettings& settings, int num_tasks,
        std::vector<float> task_input)
      : networks_(spec, settings, num_tasks), task_input_(std::move(task_input)) {}
  std::vector<Block> blocks() const override { return networks_.blocks(); }
  void act(const float* parameters, const float* observation, double* action) override {
    if (!workspace_) workspace_.emplace(networks_, 1);
    networks_.greedyActions(parameters, observation, 1, task_input_.data(), *workspace_, action);
  }

 private:
  SacNetworks networks_;
  std::vector<float> task_input_;
  std::optional<SacNetworks::ActorWorkspace> workspace_;
};

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
  std::vector<Block> blocks;
  Precision precision = Precision::kFloat32;
  table_ = experiment_.settings().learner == "q_learning"
               ? dynamic_cast<const TabularEnv*>(env_.get())
               : nullptr;
  if (table_ != nullptr) {
    precision = Precision::kFloat64;
    blocks = {{"q_table",
               {static_cast<std::size_t>(table_->numStates()),
                static_cast<std::size_t>(table_->numActions())}}};
  } else if (experiment_.settings().learner == "dqn" && spec().num_actions > 0) {
    network_ = std::make_unique<QNetwork>(dqnNetwork(spec(), experiment_.settings().dqn));
    blocks = network_->blocks();
  } else if (experiment_.settings().learner == "sac" && spec().num_actions == 0) {
    network_ = std::make_unique<Actor>(spec(), experiment_.settings().sac, experiment_.numTasks(),
                                       taskInput(file, path, as_task));
    blocks = network_->blocks();
  } else {
    throw Error("the policy file " + path + " is of learner '" + experiment_.settings().learner +
                "' on '" + spec().name + "', which cannot act from a file.");
  }
  if (model_.layout != ModelLayout(precision, std::move(blocks))) {
    throw Error("the policy file " + path + " has parameters that do not fit its own settings.");
  }
  if (network_ != nullptr) {
    network_->load(model_.floats(), static_cast<std::size_t>(spec().observation_size));
  }
}

std::vector<float> LoadedPolicy::taskInput(const PolicyFile& file, const std::string& path,
                                           int as_task) const {
  const SacSettings& sac = experiment_.settings().sac;
  if (sac.task_encoding == "none") return {};
  if (sac.task_encoding == "one_hot") {
    const int task = policy_ == PolicyKind::kPersonal ? task_ : as_task;
    if (task < 0 || task >= experiment_.numTasks()) {
      throw Error("the policy file " + path +
                  " is a meta-policy that must be told its task: choose one from 0 to " +
                  std::to_string(experiment_.numTasks() - 1) + ".");
    }
    return oneHot(task, experiment_.numTasks());
  }
  const auto size = static_cast<std::size_t>(sac.context.latent_size);
  if (policy_ == PolicyKind::kMeta) return std::vector<float>(size, 0.0f);  // the prior's mean
  std::istringstream text(textOf(file, path, "task_input"));
  std::vector<float> latent;
  for (std::string word; std::getline(text, word, ',');) {
    std::istringstream number(word);
    number.imbue(std::locale::classic());
    float value = 0;
    number >> value;
    if (!number || !number.eof() || !std::isfinite(value)) break;
    latent.push_back(value);
  }
  if (latent.size() != size) {
    throw Error("the policy file " + path + " has a task_input that is not of " +
                std::to_string(size) + " numbers.");
  }
  return latent;
}

LoadedPolicy::~LoadedPolicy() = default;
LoadedPolicy::LoadedPolicy(LoadedPolicy&&) noexcept = default;

std::string LoadedPolicy::description() const {
  const std::string whose = task_ < 0
                                ? "meta-policy of " + experiment_.settings().experiment
                                : "personal policy of " + experiment_.family().taskName(task_);
  return whose + ", round " + std::to_string(round_) + " of run " + experiment_.settings().run_id;
}

bool LoadedPolicy::act(const double* observation, double* action) {
  return table_ != nullptr ? actFromTable(observation, action)
                           : network_->actOn(observation, action);
}

bool LoadedPolicy::actFromTable(const double* observation, double* action) const {
  // what is far from any state, or not a number, must not reach stateOf()'s whole numbers
  for (int k = 0; k < spec().observation_size; ++k) {
    if (!(std::abs(observation[k]) < table_->numStates())) return false;
  }
  const int state = table_->stateOf(observation);
  if (state < 0 || state >= table_->numStates()) return false;
  const int n = table_->numActions();
  const std::size_t row = static_cast<std::size_t>(state) * static_cast<std::size_t>(n);
  if (!model_.isPresent(row)) return false;
  action[0] = greedyAction(&model_.doubles()[row], n);
  return true;
}

}  // namespace pmeta
