#include "pmeta_core/baselines/metacure_settings.h"

#include <algorithm>
#include <functional>

#include "pmeta_core/base/error.h"

namespace pmeta {

MetaCureSettings::MetaCureSettings() {
  sac.hidden = {128, 128};
  sac.reward_scale = 5;
  sac.min_log_std = -20;
  sac.head_penalty = 1e-3;
  sac.backbone = "value";
  sac.task_encoding = "given";
  sac.temperature.temperature = "fixed";
  sac.temperature.initial_temperature = 1;
}

namespace {

void bindNetworks(Settings& s, const std::string& prefix, MetaCureSettings& c) {
  s.bind(prefix + "hidden", c.sac.hidden,
         "units of each hidden layer of actors, critics, value networks and predictors",
         Range::between(1, 65536));
  s.bind(prefix + "initialisation", c.sac.initialisation,
         "how actors, critics and value networks begin: as torch's layers, or as rlkit's, with "
         "which MetaCURE was released",
         {"torch", "rlkit"});
  s.bind(prefix + "latent_size", c.latent_size, "length of the task vector z",
         Range::between(1, 1000));
  s.bind(prefix + "recurrent_units", c.recurrent_units, "units of the recurrent encoder",
         Range::between(1, 65536));
  s.bind(prefix + "kl_weight", c.kl_weight, "weight of the divergence of beliefs from the prior",
         Range::atLeast(0));
  s.bind(prefix + "learning_rate", c.learning_rate, "Adam's, of all networks", Range::above(0));
  s.bind(prefix + "gamma", c.sac.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "tau", c.sac.tau, "Polyak step of the targets", Range{0, 1, true, false});
  s.bind(prefix + "reward_scale", c.sac.reward_scale, "factor on rewards in the critics' target",
         Range::above(0));
  s.bind(prefix + "min_log_std", c.sac.min_log_std,
         "the logarithm of a policy's deviations is clamped to this and 2", Range::between(-20, 2));
  s.bind(prefix + "head_penalty", c.sac.head_penalty,
         "weight of the mean squares of a policy's means and log deviations in its loss",
         Range::atLeast(0));
}

}  // namespace

void bind(Settings& s, const std::string& prefix, MetaCureSettings& c) {
  const Range positive = Range::between(1, 1e9);
  bindNetworks(s, prefix, c);
  s.bind(prefix + "gain_weight", c.gain_weight,
         "weight of the explorer's reward for what tells of the task; 0: it has the task's alone",
         Range::atLeast(0));
  s.bind(prefix + "predicts_next", c.predicts_next,
         "that reward counts next observations, too; for tasks that differ in dynamics");
  s.bind(prefix + "pairing", c.pairing,
         "the explorer learns from its trials, or as released: from the replay, each transition "
         "beside the belief of another sequence",
         {"trial", "released"});
  s.bind(prefix + "meta_batch", c.meta_batch,
         "tasks of one update, drawn with repetition, a trial of each", Range::between(1, 1000));
  s.bind(prefix + "task_batch", c.task_batch, "transitions of each task in an update",
         Range::between(1, 1e5));
  s.bind(prefix + "buffer_size", c.buffer_size,
         "transitions that each task's replay holds; 0: all of the run", Range::between(0, 1e9));
  s.bind(prefix + "trial_buffer", c.trial_buffer, "trials that each task keeps",
         Range::between(1, 1e6));
  s.bind(prefix + "trial_episodes", c.trial_episodes, "episodes of one trial of the explorer",
         Range::between(1, 1000));
  s.bind(prefix + "warm_up_steps", c.warm_up_steps,
         "steps of the first explorer on each task, in whole trials, before the first iteration",
         positive);
  s.bind(prefix + "tasks_per_iteration", c.tasks_per_iteration,
         "tasks that an iteration acts on, drawn with repetition, the explorer for a trial",
         Range::between(1, 1e5));
  s.bind(prefix + "prior_steps", c.prior_steps,
         "steps of the exploiter on each of them, in whole episodes, on z from the prior",
         Range::between(0, 1e9));
  s.bind(prefix + "posterior_steps", c.posterior_steps,
         "steps of the exploiter after those, in whole episodes, on z from the trial's last belief",
         Range::between(0, 1e9));
  s.bind(prefix + "updates_per_iteration", c.updates_per_iteration,
         "updates after an iteration's steps", positive);
  s.bind(prefix + "exploration_episodes", c.exploration_episodes,
         "episodes that precede an evaluation, each giving returns of its own; ascending",
         Range::between(1, 1000));
  s.bind(prefix + "evaluation_episodes", c.sac.evaluation_episodes,
         "episodes of one evaluation, without exploration", Range::between(1, 100000));
}

void check(const MetaCureSettings& c, int num_tasks) {
  if (num_tasks < 2) {
    throw Error(
        "MetaCURE learns to tell tasks apart and needs two or more to train on, but the "
        "environment has " +
        std::to_string(num_tasks) + ".");
  }
  const std::vector<int>& counts = c.exploration_episodes;
  if (std::adjacent_find(counts.begin(), counts.end(), std::greater_equal<int>()) != counts.end()) {
    throw Error("metacure.exploration_episodes must be ascending, e.g. [2, 5].");
  }
}

SacSettings exploiterSettings(const MetaCureSettings& c) {
  SacSettings sac = c.sac;
  sac.batch_size = c.meta_batch * c.task_batch;
  return sac;
}

SacSettings explorerSettings(const MetaCureSettings& c) {
  SacSettings sac = exploiterSettings(c);
  sac.prefix = "explorer_";
  return sac;
}

}  // namespace pmeta
