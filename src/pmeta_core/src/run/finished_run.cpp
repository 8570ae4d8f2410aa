#include "pmeta_core/run/finished_run.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/meta_trainer.h"
#include "pmeta_core/run/task_agent.h"

namespace pmeta {

FinishedRun::FinishedRun(std::string run_dir, Kept kept, const std::vector<std::string>& overrides)
    : run_dir_(std::move(run_dir)),
      kept_(kept),
      experiment_(Experiment::load(run_dir_ + "/config.yaml", overrides)) {
  bool some = false;
  for (int task = -1; task < experiment_.numTasks(); ++task) {
    const auto policy = load(task < 0 ? PolicyKind::kMeta : PolicyKind::kPersonal, task);
    if (!policy) continue;
    some = true;
    round_ = std::max(round_, policy->round());
  }
  if (!some) {
    throw Error(run_dir_ + " has no policies below " + policiesFolder(kept_) +
                "/: only a run that is over keeps them.");
  }
}

std::unique_ptr<LoadedPolicy> FinishedRun::load(PolicyKind policy, int task) const {
  const std::string path = policyPath(run_dir_, kept_, policy, task);
  if (!std::filesystem::exists(path)) return nullptr;
  // a meta-policy that is told its task is told it by each agent: 0 stands for any
  return std::make_unique<LoadedPolicy>(path, policy == PolicyKind::kMeta ? 0 : -1);
}

std::optional<ShownPolicy> FinishedRun::personal(int task) const {
  const std::unique_ptr<LoadedPolicy> policy = load(PolicyKind::kPersonal, task);
  if (!policy) return std::nullopt;
  ShownPolicy shown;
  shown.episode = policy->record();
  Rng rng(static_cast<std::uint64_t>(experiment_.settings().seed), static_cast<std::uint64_t>(task),
          Stream::kEvaluate);
  const ReturnStats stats =
      experiment_.makeLearner(task)->evaluate(policy->model(), policy->taskInput(), rng);
  shown.result.run_id = experiment_.settings().run_id;
  shown.result.task = task;
  shown.result.round = policy->round();
  shown.result.mean = stats.mean;
  shown.result.std = stats.std;
  shown.result.episodes = stats.episodes;
  shown.result.broken_episodes = stats.broken_episodes;
  return shown;
}

std::vector<ShownPolicy> FinishedRun::meta() const {
  std::vector<ShownPolicy> all;
  const std::unique_ptr<LoadedPolicy> policy = load(PolicyKind::kMeta, -1);
  if (!policy) return all;
  MetaPolicy meta;
  meta.run_id = experiment_.settings().run_id;
  meta.round = policy->round();
  meta.model = policy->model();
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
