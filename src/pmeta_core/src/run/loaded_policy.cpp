#include "pmeta_core/run/loaded_policy.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "pmeta_core/base/error.h"
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

}  // namespace

struct LoadedPolicy::Network {
  Network(Mlp network, const std::vector<float>& values)
      : mlp(std::move(network)),
        workspace(mlp, 1),
        parameters(values.begin(), values.end()),
        observation(mlp.inputs()) {}

  Mlp mlp;
  MlpWorkspace workspace;
  AlignedFloats parameters;
  std::vector<float> observation;
};

LoadedPolicy::LoadedPolicy(const std::string& path) : LoadedPolicy(path, loadPolicy(path)) {}

LoadedPolicy::LoadedPolicy(const std::string& path, PolicyFile file)
    : experiment_(Experiment::parse(textOf(file, path, "settings"), "the policy file " + path)),
      model_(std::move(file.model)) {
  round_ = numberOf(file, path, "round", experiment_.settings().rounds);
  const std::string& policy = textOf(file, path, "policy");
  if (policy == name(Policy::kPersonal)) {
    policy_ = Policy::kPersonal;
    task_ = numberOf(file, path, "task", experiment_.numTasks() - 1);
  } else if (policy != name(Policy::kMeta)) {
    throw Error("the policy file " + path + " is of neither a personal nor a meta policy.");
  }
  env_ = experiment_.family().make(std::max(task_, 0));

  // the layout that the settings give is known before anything of its size is allocated
  std::vector<Block> blocks;
  Precision precision = Precision::kFloat32;
  std::unique_ptr<Mlp> mlp;
  table_ = experiment_.settings().learner == "q_learning"
               ? dynamic_cast<const TabularEnv*>(env_.get())
               : nullptr;
  if (table_ != nullptr) {
    precision = Precision::kFloat64;
    blocks = {{"q_table",
               {static_cast<std::size_t>(table_->numStates()),
                static_cast<std::size_t>(table_->numActions())}}};
  } else if (experiment_.settings().learner == "dqn" && spec().num_actions > 0) {
    mlp = std::make_unique<Mlp>(dqnNetwork(spec(), experiment_.settings().dqn));
    blocks = mlp->blocks();
  } else {
    throw Error("the policy file " + path + " is of learner '" + experiment_.settings().learner +
                "' on '" + spec().name + "', which cannot act from a file.");
  }
  if (model_.layout != ModelLayout(precision, std::move(blocks))) {
    throw Error("the policy file " + path + " has parameters that do not fit its own settings.");
  }
  if (mlp != nullptr) network_ = std::make_unique<Network>(std::move(*mlp), model_.floats());
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
                           : actFromNetwork(observation, action);
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

bool LoadedPolicy::actFromNetwork(const double* observation, double* action) {
  Network& network = *network_;
  for (std::size_t k = 0; k < network.observation.size(); ++k) {
    network.observation[k] = static_cast<float>(observation[k]);
    if (!std::isfinite(network.observation[k])) return false;
  }
  const float* values = network.mlp.forward(network.parameters.data(), network.observation.data(),
                                            1, network.workspace);
  action[0] =
      static_cast<double>(std::max_element(values, values + network.mlp.outputs()) - values);
  return true;
}

}  // namespace pmeta
