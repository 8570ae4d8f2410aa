#include "pmeta_core/run/trace.h"

#include <filesystem>
#include <memory>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/run/meta_trainer.h"
#include "pmeta_core/run/task_agent.h"
#include "pmeta_core/storage/run_lock.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {
namespace {

class Table {
 public:
  void add(PolicyKind policy, Split split, int task, int context_episodes, const Episode& episode) {
    size_ = static_cast<std::size_t>(episode.observation_size);
    const std::string whose = std::string(name(policy)) + "," + name(split) + "," +
                              std::to_string(task) + "," + std::to_string(context_episodes);
    for (std::size_t step = 0; (step + 1) * size_ <= episode.observations.size(); ++step) {
      rows_ += whose + "," + std::to_string(step);
      for (std::size_t k = 0; k < size_; ++k) {
        rows_ += "," + formatNumber(episode.observations[step * size_ + k]);
      }
      rows_ += "\n";
    }
  }

  bool empty() const { return rows_.empty(); }

  std::string text() const {
    std::string header = "policy,split,task,context_episodes,step";
    for (std::size_t k = 0; k < size_; ++k) header += ",observation_" + std::to_string(k);
    return header + "\n" + rows_;
  }

 private:
  std::size_t size_ = 0;
  std::string rows_;
};

// after the last number of exploration episodes that `experiment` has
void addMeta(const Experiment& experiment, const Model& model, Table& table) {
  MetaPolicy meta;
  meta.model = model;
  meta.evaluate = true;
  const auto add = [&](Party& party) {
    party.evaluateMeta(meta);
    for (const int task : party.tasks()) {
      table.add(PolicyKind::kMeta, experiment.isTestTask(task) ? Split::kTest : Split::kTrain, task,
                experiment.contextEpisodes().back(), party.recordMeta(meta, task));
    }
  };
  if (experiment.hasMetaLearner()) {
    MetaTrainer trainer(experiment);
    return add(trainer);
  }
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    TaskAgent agent(experiment, task);
    add(agent);
  }
}

}  // namespace

void writeTrajectories(const std::string& run_dir) {
  const std::string config = run_dir + "/config.yaml";
  const Experiment experiment = Experiment::load(config);
  const RunLock lock(run_dir);
  Table table;
  for (int task = 0; task < experiment.numTasks(); ++task) {
    const std::string path = run_dir + "/policies/task_" + std::to_string(task) + ".safetensors";
    if (!std::filesystem::exists(path)) continue;
    table.add(PolicyKind::kPersonal, Split::kTrain, task, 0, LoadedPolicy(path).record());
  }
  const std::string path = run_dir + "/policies/meta.safetensors";
  if (std::filesystem::exists(path)) {
    // a meta-policy that is told its task is told it by each agent: 0 stands for any
    const LoadedPolicy meta(path, 0);
    for (const int count : experiment.contextEpisodes()) {
      if (count > 0) {
        addMeta(Experiment::load(config, {"exploration_episodes:=[" + std::to_string(count) + "]"}),
                meta.model(), table);
      } else if (experiment.contextEpisodes().size() == 1) {
        addMeta(experiment, meta.model(), table);
      }
    }
  }
  if (table.empty()) {
    throw Error(run_dir + " has no policies below policies/: only a run that is over keeps them.");
  }
  writeFileAtomically(run_dir + "/trajectories.csv", table.text());
}

}  // namespace pmeta
