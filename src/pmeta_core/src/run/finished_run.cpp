#include "pmeta_core/run/finished_run.h"

#include <filesystem>
#include <memory>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/meta_trainer.h"
#include "pmeta_core/run/task_agent.h"

namespace pmeta {
namespace {

std::string nameOf(int task) { return "task_" + std::to_string(task); }

}  // namespace

FinishedRun::FinishedRun(std::string run_dir, const std::vector<std::string>& overrides)
    : run_dir_(std::move(run_dir)),
      experiment_(Experiment::load(run_dir_ + "/config.yaml", overrides)) {
  std::string some = policyPath("meta");
  for (int task = 0; task < experiment_.numTasks() && some.empty(); ++task) {
    some = policyPath(nameOf(task));
  }
  if (some.empty()) {
    throw Error(run_dir_ + " has no policies below policies/: only a run that is over keeps them.");
  }
  // a meta-policy that is told its task is told it by each agent: 0 stands for any
  round_ = LoadedPolicy(some, some == policyPath("meta") ? 0 : -1).round();
}

std::string FinishedRun::policyPath(const std::string& name) const {
  const std::string path = run_dir_ + "/policies/" + name + ".safetensors";
  return std::filesystem::exists(path) ? path : "";
}

std::optional<ShownPolicy> FinishedRun::personal(int task) const {
  const std::string path = policyPath(nameOf(task));
  if (path.empty()) return std::nullopt;
  LoadedPolicy policy(path);
  ShownPolicy shown;
  shown.episode = policy.record();
  Rng rng(static_cast<std::uint64_t>(experiment_.settings().seed), static_cast<std::uint64_t>(task),
          Stream::kEvaluate);
  const ReturnStats stats =
      experiment_.makeLearner(task)->evaluate(policy.model(), policy.taskInput(), rng);
  shown.result.run_id = experiment_.settings().run_id;
  shown.result.task = task;
  shown.result.round = policy.round();
  shown.result.mean = stats.mean;
  shown.result.std = stats.std;
  shown.result.episodes = stats.episodes;
  shown.result.broken_episodes = stats.broken_episodes;
  return shown;
}

std::vector<ShownPolicy> FinishedRun::meta() const {
  std::vector<ShownPolicy> all;
  const std::string path = policyPath("meta");
  if (path.empty()) return all;
  MetaPolicy meta;
  meta.run_id = experiment_.settings().run_id;
  meta.round = round_;
  meta.model = LoadedPolicy(path, 0).model();
  meta.evaluate = true;
  const auto add = [&](Party& party) {
    for (TaskReturn& result : party.evaluateMeta(meta)) {
      if (result.context_episodes != experiment_.contextEpisodes().back()) continue;
      Episode episode = party.recordMeta(meta, result.task);
      all.push_back({std::move(result), std::move(episode)});
    }
  };
  if (experiment_.hasMetaLearner()) {
    MetaTrainer trainer(experiment_);
    add(trainer);
    return all;
  }
  for (int task = 0; task < experiment_.totalTasks(); ++task) {
    TaskAgent agent(experiment_, task);
    add(agent);
  }
  return all;
}

}  // namespace pmeta
