#include "pmeta_core/baselines/rl2_settings.h"

#include <algorithm>
#include <functional>

#include "pmeta_core/base/error.h"

namespace pmeta {

void bind(Settings& s, const std::string& prefix, Rl2Settings& d) {
  const Range positive = Range::between(1, 1e6);
  s.bind(prefix + "hidden", d.hidden, "units of the recurrent network", Range::between(1, 65536));
  s.bind(prefix + "head", d.head,
         "tanh units of each layer between it and the policy's mean, and the value; [] for none",
         Range::between(1, 65536), Empty::kAllowed);
  s.bind(prefix + "initialisation", d.initialisation, "of weights", {"orthogonal", "glorot"});
  s.bind(prefix + "initial_log_std", d.initial_log_std, "of the policy's free log std",
         Range::between(-10, 10));
  s.bind(prefix + "trials", d.trials, "trials of one iteration, the tasks in turn", positive);
  s.bind(prefix + "episodes", d.episodes, "episodes of one trial", Range::between(1, 1000));
  s.bind(prefix + "gamma", d.gamma, "discount, over the whole trial", Range::between(0, 1));
  s.bind(prefix + "gae_lambda", d.gae_lambda, "lambda of advantages, over the whole trial",
         Range::between(0, 1));
  s.bind(prefix + "baseline", d.baseline,
         "of advantages: value (the critic), or linear in features of observation and step, fitted "
         "to each task's trials; the critic then learns nothing",
         {"value", "linear"});
  s.bind(prefix + "scale_rewards", d.scale_rewards,
         "divides rewards by the running deviation of the discounted return");
  s.bind(prefix + "learning_rate", d.learning_rate, "Adam's step size", Range::above(0));
  s.bind(prefix + "epochs", d.epochs, "passes over the trials of one iteration", positive);
  s.bind(prefix + "minibatches", d.minibatches, "updates of one pass, each on whole trials",
         positive);
  s.bind(prefix + "max_gradient_norm", d.max_gradient_norm, "longer gradients are cut to it",
         Range::above(0));
  s.bind(prefix + "clip", d.ppo.clip, "how far the ratio of densities may leave 1",
         Range::above(0));
  s.bind(prefix + "value_coefficient", d.ppo.value_coefficient, "weight of the values' loss",
         Range::atLeast(0));
  s.bind(prefix + "huber", d.ppo.huber, "Huber loss of values, else squared");
  s.bind(prefix + "clip_values", d.ppo.clip_values, "values are clipped as the ratio is");
  s.bind(prefix + "entropy_coefficient", d.ppo.entropy_coefficient, "weight of the entropy",
         Range::atLeast(0));
  s.bind(prefix + "exploration_episodes", d.exploration_episodes,
         "episodes that precede an evaluation, each giving returns of its own; ascending",
         Range::between(1, 1000));
  s.bind(prefix + "evaluation_episodes", d.evaluation_episodes, "episodes of one evaluation",
         Range::between(1, 100000));
}

void check(const Rl2Settings& s) {
  const std::vector<int>& counts = s.exploration_episodes;
  if (std::adjacent_find(counts.begin(), counts.end(), std::greater_equal<int>()) != counts.end()) {
    throw Error("rl2.exploration_episodes must be ascending, e.g. [1, 2].");
  }
  if (s.minibatches > s.trials) {
    throw Error("rl2.minibatches (" + std::to_string(s.minibatches) +
                ") must not be more than rl2.trials (" + std::to_string(s.trials) +
                "): a minibatch holds at least one whole trial.");
  }
}

}  // namespace pmeta
