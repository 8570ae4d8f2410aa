#include "pmeta_core/learn/sac_settings.h"

namespace pmeta {

void bind(Settings& s, const std::string& prefix, SacSettings& d) {
  const Range positive = Range::between(1, 1e9);
  s.bind(prefix + "hidden", d.hidden, "units of each hidden layer of actor and critics",
         Range::between(1, 65536));
  s.bind(prefix + "batch_size", d.batch_size, "transitions of one update", Range::between(1, 1e6));
  s.bind(prefix + "buffer_size", d.buffer_size, "transitions the replay holds", positive);
  s.bind(prefix + "gamma", d.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "tau", d.tau, "Polyak step of the target critics", Range{0, 1, true, false});
  s.bind(prefix + "reward_scale", d.reward_scale, "factor on rewards in the critics' target",
         Range::above(0));
  s.bind(prefix + "warm_up_steps", d.warm_up_steps,
         "uniformly random steps before the first update", Range::between(1, 1e9));
  s.bind(prefix + "env_steps_per_update", d.env_steps_per_update,
         "environment steps before each update", Range::between(1, 1e6));
  bind(s, prefix, d.temperature);
  s.bind(prefix + "task_encoding", d.task_encoding,
         "what tells the networks the task: one_hot (its number), model (the same in training; a "
         "meta-policy finds it out by a learnt model), inference (from recent transitions) or none",
         {"one_hot", "model", "inference", "none"});
  bind(s, prefix, d.context);
  pmeta::bind(s, prefix + "task_model.", d.task_model);
  s.bind(prefix + "evaluation_episodes", d.evaluation_episodes,
         "episodes of one evaluation, without exploration", Range::between(1, 100000));
  s.bind(prefix + "targets_at_round", d.targets_at_round,
         "target critics at a round's start: keep, or meta (the meta-policy's critics)",
         {"keep", "meta"});
  s.bind(prefix + "reset_moments", d.reset_moments, "Adam's moments begin anew with each round");
  s.bind(prefix + "own_column", d.own_column,
         "with one_hot and model: a task's own input column is aggregated from that task alone");
}

}  // namespace pmeta
