#include "pmeta_core/learn/dqn_settings.h"

#include "pmeta_core/base/error.h"

namespace pmeta {

MlpSpec dqnNetwork(const EnvSpec& env, const DqnSettings& settings) {
  if (env.num_actions < 1) {
    throw Error("environment '" + env.name + "' has continuous actions: DQN needs discrete ones.");
  }
  MlpSpec spec = mlpSpec("q", static_cast<std::size_t>(env.observation_size), settings.hidden,
                         static_cast<std::size_t>(env.num_actions), settings.portable);
  spec.dueling = settings.dueling;
  return spec;
}

void bind(Settings& s, const std::string& prefix, DqnSettings& d) {
  const Range positive = Range::between(1, 1e9);
  s.bind(prefix + "hidden", d.hidden, "units of each hidden layer", Range::between(1, 65536));
  s.bind(prefix + "batch_size", d.batch_size, "transitions of one update", Range::between(1, 1e6));
  s.bind(prefix + "buffer_size", d.buffer_size, "transitions the replay holds", positive);
  s.bind(prefix + "gamma", d.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "n_step", d.n_step, "rewards summed before bootstrapping",
         Range::between(1, 1000));
  s.bind(prefix + "double_q", d.double_q, "the online network chooses the action of the target");
  s.bind(prefix + "dueling", d.dueling, "state value and advantages apart");
  s.bind(prefix + "huber", d.huber, "Huber loss with threshold 1 instead of the square");
  s.bind(prefix + "target_update_interval", d.target_update_interval,
         "updates between copies to the target network", positive);
  s.bind(prefix + "averaged_targets", d.averaged_targets,
         "target networks whose mean is the target; 1: plain DQN", Range::between(1, 100));
  s.bind(prefix + "epsilon_start", d.epsilon_start, "exploration rate at the first update",
         Range::between(0, 1));
  s.bind(prefix + "epsilon_finish", d.epsilon_finish, "exploration rate at the end of its slope",
         Range::between(0, 1));
  s.bind(prefix + "epsilon_fraction", d.epsilon_fraction,
         "length of the slope as a share of all updates", Range::between(0, 1));
  s.bind(prefix + "num_envs", d.num_envs, "environments stepped in parallel",
         Range::between(1, 10000));
  s.bind(prefix + "env_steps_per_update", d.env_steps_per_update,
         "steps in each environment before an update", Range::between(1, 1e6));
  s.bind(prefix + "warm_up_steps", d.warm_up_steps,
         "random steps in each environment before the first update; at least n_step",
         Range::between(1, 1e6));
  s.bind(prefix + "bootstrap_at_limit", d.bootstrap_at_limit,
         "the horizon is no terminal state to the target");
  s.bind(prefix + "priority_alpha", d.priority_alpha, "how far priorities count; 0: uniform replay",
         Range::between(0, 1));
  s.bind(prefix + "priority_beta", d.priority_beta, "how far importance weights correct for that",
         Range::between(0, 1));
  s.bind(prefix + "evaluation_episodes", d.evaluation_episodes, "greedy episodes of one evaluation",
         Range::between(1, 100000));
}

void requireSamples(const DqnSettings& d) {
  if (d.warm_up_steps >= d.n_step) return;
  throw Error("dqn.warm_up_steps is " + std::to_string(d.warm_up_steps) + " but dqn.n_step is " +
              std::to_string(d.n_step) + ": nothing could be sampled; give at least as many.");
}

}  // namespace pmeta
