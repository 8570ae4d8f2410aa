#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/baselines/rl2_settings.h"
#include "pmeta_core/env/env_spec.h"
#include "pmeta_core/nn/gru.h"
#include "pmeta_core/nn/initialisation.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// What RL² learns: a recurrent network over a trial's steps, and on its hidden state the mean of
/// normal actions and the value. The log std are free parameters. Flat parameters: "gru", "mean",
/// "value", "log_std".
///
/// Input of step t: (s_t, a_{t-1}, r_{t-1}, d_{t-1}): the observation, then the last action as it
/// was drawn, its reward as policies are judged by, and 1 if an episode ended there. At a trial's
/// start those are 0; from one of its episodes to the next they are kept.
class Rl2Networks {
 public:
  /// Throws Error where actions are discrete.
  Rl2Networks(const EnvSpec& env, const Rl2Settings& settings);

  /// Numbers of an observation.
  std::size_t observationSize() const { return observation_size_; }
  /// Numbers of an action.
  std::size_t actionSize() const { return action_size_; }
  std::size_t lastSize() const { return action_size_ + 2; }  ///< of a, r, d

  const Gru& gru() const { return gru_; }  ///< its parameters begin at 0
  /// From hidden state to the mean of u.
  const Mlp& mean() const { return mean_; }
  /// From hidden state to the value.
  const Mlp& value() const { return value_; }
  /// Where the parameters of mean() begin.
  std::size_t meanOffset() const { return gru_.size(); }
  /// Where those of value() begin.
  std::size_t valueOffset() const { return meanOffset() + mean_.size(); }
  /// Where the log std begin.
  std::size_t logStdOffset() const { return valueOffset() + value_.size(); }
  /// Number of all parameters.
  std::size_t size() const { return logStdOffset() + action_size_; }

  /// Of all, in order.
  std::vector<Block> blocks() const;
  /// Weights as the settings say, biases 0.
  void initialise(float* parameters, Rng& rng) const;

 private:
  std::size_t observation_size_, action_size_;
  Initialisation initialisation_;
  float initial_log_std_;
  Gru gru_;
  Mlp mean_, value_;
};

/// Policies that remember a trial. What actor() gives knows nothing of the task when an episode
/// begins.
class Rl2Policies : public PolicyFamily {
 public:
  /// As Rl2Networks.
  Rl2Policies(const EnvSpec& env, const Rl2Settings& settings);

  /// What the parameters are of.
  const Rl2Networks& networks() const { return networks_; }

  PolicyForm form() const override { return {"tanh", "none", ""}; }
  std::size_t taskInputSize() const override { return 0; }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  Rl2Networks networks_;
};

}  // namespace pmeta
