#include "pmeta_core/run/local_runner.h"

#include <chrono>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/policy_file.h"

namespace pmeta {
namespace {

void savePolicies(const Experiment& experiment, const MetaPolicy& meta,
                  const std::vector<TaskAgent>& agents) {
  saveRunPolicy(experiment, Policy::kMeta, -1, meta.round, meta.model);
  for (const TaskAgent& agent : agents) {
    if (!agent.trains()) continue;
    saveRunPolicy(experiment, Policy::kPersonal, agent.task(), meta.round, agent.personal(),
                  agent.taskInput());
  }
}

}  // namespace

LocalResult runLocally(const Experiment& experiment, RunLog* log, const OnRound& on_round) {
  MetaAggregator aggregator(experiment);
  RoundBook book(experiment);
  std::vector<TaskAgent> agents;
  for (int task = 0; task < experiment.totalTasks(); ++task) agents.emplace_back(experiment, task);

  const int fresh_episodes = experiment.settings().fresh_episodes;
  FreshEvaluation fresh;
  LocalResult result;
  for (int round = 1; round <= experiment.settings().rounds && !result.stopped; ++round) {
    const auto start = std::chrono::steady_clock::now();
    for (TaskAgent& agent : agents) {
      if (!agent.trains()) continue;
      auto trained = agent.trainRound(aggregator.metaPolicy());
      if (trained->personal) book.add(*trained->personal);
      const MetaAggregator::Answer answer =
          aggregator.offer(std::make_shared<AuxiliaryUpdate>(std::move(trained->update)));
      if (answer.verdict != MetaAggregator::Verdict::kAccepted) throw Error(answer.reason);
    }
    const std::vector<int> missing = aggregator.closeRound();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    book.closeRound(round, aggregator.metaPolicy().participants, missing, seconds.count(),
                    aggregator.excluded());
    for (TaskAgent& agent : agents) {
      if (!experiment.evaluatesMeta()) break;
      for (const TaskReturn& result : agent.evaluateMeta(aggregator.metaPolicy())) book.add(result);
    }
    for (RoundBook::Round& done : book.take()) {
      if (fresh_episodes > 0 && !done.rows.empty())
        fresh.offer(done, agents, aggregator.metaPolicy());
      if (log != nullptr) log->write(done);
      if (on_round && !on_round(done)) {
        result.stopped = round < experiment.settings().rounds;
      }
      result.rounds.push_back(std::move(done));
    }
  }
  if (fresh_episodes > 0 && !result.stopped) {
    result.fresh = fresh.evaluate(agents, fresh_episodes, !experiment.evaluatesMeta());
    if (log != nullptr) {
      writeFileAtomically(log->dir() + "/final.csv", FreshEvaluation::csv(result.fresh));
    }
  }
  if (log != nullptr) savePolicies(experiment, aggregator.metaPolicy(), agents);
  result.meta = aggregator.metaPolicy().model;
  return result;
}

}  // namespace pmeta
