#include "pmeta_core/baselines/pearl_settings.h"

#include <algorithm>

#include "pmeta_core/base/error.h"

namespace pmeta {

PearlSettings::PearlSettings() {
  sac.hidden = {128, 128};
  sac.reward_scale = 5;
  sac.min_log_std = -20;
  sac.head_penalty = 1e-3;
  sac.temperature.initial_temperature = 1;
  sac.temperature.temperature_learning_rate = 3e-4;
  sac.task_encoding = "inference";
  sac.context.hidden = {128, 128};
  sac.context.batch_size = 128;
}

void bind(Settings& s, const std::string& prefix, PearlSettings& p) {
  const Range positive = Range::between(1, 1e9);
  s.bind(prefix + "backbone", p.sac.backbone,
         "what values next states: twin (target copies of both critics) or value (a network of "
         "its own and its target copy)",
         {"twin", "value"});
  s.bind(prefix + "hidden", p.sac.hidden,
         "units of each hidden layer of actor, critics and value network",
         Range::between(1, 65536));
  s.bind(prefix + "initialisation", p.sac.initialisation,
         "how networks begin: as torch's layers, or as rlkit's, with which PEARL was released",
         {"torch", "rlkit"});
  s.bind(prefix + "learning_rate", p.learning_rate, "Adam's, of all networks", Range::above(0));
  s.bind(prefix + "gamma", p.sac.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "tau", p.sac.tau, "Polyak step of the targets", Range{0, 1, true, false});
  s.bind(prefix + "reward_scale", p.sac.reward_scale, "factor on rewards in the critics' target",
         Range::above(0));
  s.bind(prefix + "min_log_std", p.sac.min_log_std,
         "the logarithm of the policy's deviations is clamped to this and 2",
         Range::between(-20, 2));
  s.bind(prefix + "head_penalty", p.sac.head_penalty,
         "weight of the mean squares of the policy's means and log deviations in its loss",
         Range::atLeast(0));
  bind(s, prefix, p.sac.temperature);
  bindEncoder(s, prefix, p.sac.context);
  s.bind(prefix + "meta_batch", p.meta_batch, "tasks of one update, drawn with repetition",
         Range::between(1, 10000));
  s.bind(prefix + "task_batch", p.task_batch, "transitions of each task in an update",
         Range::between(1, 1e5));
  s.bind(prefix + "buffer_size", p.buffer_size,
         "transitions that each task's replay holds; 0: all of the run", Range::between(0, 1e9));
  s.bind(prefix + "warm_up_steps", p.warm_up_steps,
         "steps of the first policy on each task before the first iteration", positive);
  s.bind(prefix + "tasks_per_iteration", p.tasks_per_iteration,
         "tasks that an iteration acts on, drawn with repetition", Range::between(1, 1e5));
  s.bind(prefix + "prior_steps", p.prior_steps,
         "steps on each of them, in whole episodes, on z from the prior; they are its context",
         positive);
  s.bind(prefix + "posterior_steps", p.posterior_steps,
         "steps on each of them after those, in whole episodes, on z from q(z|c)",
         Range::between(0, 1e9));
  s.bind(prefix + "updates_per_iteration", p.updates_per_iteration,
         "updates after an iteration's steps", positive);
  s.bind(prefix + "evaluation_episodes", p.sac.evaluation_episodes,
         "episodes of one evaluation, without exploration", Range::between(1, 100000));
}

void check(const PearlSettings& p, int num_tasks) {
  if (num_tasks < 2) {
    throw Error(
        "PEARL learns to tell tasks apart and needs two or more to train on, but the environment "
        "has " +
        std::to_string(num_tasks) + ".");
  }
  if (p.sac.backbone == "value" && p.sac.temperature.temperature != "fixed") {
    throw Error(
        "pearl.backbone value has no target entropy: set pearl.temperature to fixed, or "
        "pearl.backbone to twin.");
  }
  check(p.sac.context, "pearl.");
}

SacSettings updateSettings(const PearlSettings& p, int horizon) {
  SacSettings sac = p.sac;
  sac.batch_size = p.meta_batch * p.task_batch;
  sac.context.per_update = p.meta_batch;
  // SacUpdate takes the mean over the contexts, PEARL the sum over the tasks
  sac.context.kl_weight *= p.meta_batch;
  // all of a visit, whose episodes may overshoot, or of the warm-up
  sac.context.buffer_size =
      std::max(p.warm_up_steps, p.prior_steps + p.posterior_steps + horizon) + horizon;
  return sac;
}

}  // namespace pmeta
