#pragma once

#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/run/task_agent.h"

namespace pmeta::test {

/// Small experiments of each learner, with what a checkpoint could forget.
inline std::string checkpointYaml(const std::string& kind) {
  const std::string head = "experiment: " + kind +
                           "\nrun_id: run\nrounds: 6\nupdates_per_round: 12\n"
                           "evaluation_interval: 2\ncheckpoint: {interval: 1}\n"
                           "aggregation: {catch_up: 0.5}\n";
  if (kind == "table") {
    return head +
           "personal: {personal_init: keep}\n"
           "environment: {name: gridworld, sizes: [3, 4], slip: 0.1}\n";
  }
  if (kind == "dqn") {
    return head +
           "learner: dqn\n"
           "dqn: {hidden: [6, 5], batch_size: 8, buffer_size: 150, n_step: 4, num_envs: 3, "
           "warm_up_steps: 10, target_update_interval: 7, averaged_targets: 3, "
           "evaluation_episodes: 2, dueling: true}\n"
           "environment: {name: cart_pole, force_mag: [10, 20], masspole: [0.1], length: [0.5]}\n";
  }
  const std::string sac =
      "learner: sac\nfresh_episodes: 3\n"
      "sac: {hidden: [8, 6], batch_size: 8, buffer_size: 90, warm_up_steps: 25, "
      "evaluation_episodes: 2, ";
  if (kind == "sac_one_hot") {
    return head + sac +
           "task_encoding: one_hot}\n"
           "environment: {name: half_cheetah_dir, horizon: 15}\n";
  }
  const std::string points =
      "environment: {name: sparse_point_robot, train_tasks: 2, test_tasks: 1, horizon: 10}\n";
  if (kind == "sac_model") {
    return head + sac +
           "task_encoding: model, exploration_episodes: [1, 2], task_model: {hidden: [6], "
           "buffer_size: 40, exploring_interval: 2}}\n" +
           points;
  }
  return head + sac +
         "task_encoding: inference, context_hidden: [6], latent_size: 2, context_batch: 6, "
         "context_buffer: 40, exploration_episodes: [1, 2]}\n" +
         points;
}

inline const std::vector<std::string>& checkpointKinds() {
  static const std::vector<std::string> kinds = {"table", "dqn", "sac_one_hot", "sac_context",
                                                 "sac_model"};
  return kinds;
}

inline Experiment checkpointExperiment(const std::string& kind, const std::string& results_dir,
                                       std::vector<std::string> overrides = {}) {
  overrides.push_back("results_dir:=" + results_dir);
  return Experiment::parse(checkpointYaml(kind), kind + ".yaml", overrides);
}

/// An agent that has trained some rounds.
inline TaskAgent trainedAgent(const Experiment& experiment, int rounds, int task = 1) {
  TaskAgent agent(experiment, task);
  MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
  for (; meta.round < rounds; ++meta.round) {
    agent.evaluateMeta(meta);
    agent.trainRound(meta);
  }
  return agent;
}

}  // namespace pmeta::test
