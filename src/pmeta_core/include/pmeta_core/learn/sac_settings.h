#pragma once

#include <string>
#include <vector>

#include "pmeta_core/act/gaussian_policy.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/task_model.h"
#include "pmeta_core/learn/temperature.h"

namespace pmeta {

/// Settings of soft actor-critic.
struct SacSettings {
  std::vector<int> hidden = {512, 512};  ///< units of each hidden layer of actor and critics
  int batch_size = 256;                  ///< transitions of one update
  int buffer_size = 100000;              ///< transitions the replay holds
  double gamma = 0.99;                   ///< discount
  double tau = 0.005;                    ///< Polyak step of the target critics
  double reward_scale = 1;               ///< factor on rewards in the critics' target
  int warm_up_steps = 1000;              ///< uniformly random steps before the first update
  int env_steps_per_update = 1;          ///< environment steps before each update
  TemperatureSettings temperature;       ///< weight of the entropy
  /// What tells the networks the task besides the observation: "one_hot" (the task's number),
  /// "model" (the same, and a model that is learnt of the tasks finds it out at test time),
  /// "inference" (a latent vector that the context encoder infers), "none", or, of learners of all
  /// tasks, "multi_head" (the number, which also chooses among last layers, one for each task) and
  /// "given" (an input that the learner makes itself).
  std::string task_encoding = "one_hot";
  ContextSettings context;       ///< with task_encoding "inference"; exploration with "model", too
  TaskModelSettings task_model;  ///< with task_encoding "model"
  int evaluation_episodes = 5;   ///< episodes of one evaluation, by tanh(mean)
  bool portable = false;         ///< see MlpSpec; set by the experiment's `arithmetic`

  // what baselines alone have a choice of
  /// What next states are worth by: "twin", target copies of both critics, or "value", a target
  /// copy of a network of its own (as in "Soft Actor-Critic: Off-Policy Maximum Entropy Deep
  /// Reinforcement Learning", 2018), which learns min_k Q_k(s, x, a) - alpha log pi(a).
  std::string backbone = "twin";
  /// A batch's rows are of so many tasks, in equal parts, whose gradients of critics and actor are
  /// operated on where they conflict: see operate(). 0: they are not.
  int surgery_tasks = 0;
  std::string prefix;  ///< of the names of all networks, where there are others beside them
  double min_log_std = GaussianPolicy::kMinLogStd;  ///< see GaussianPolicy
  double head_penalty = 0;                          ///< see GaussianPolicy::addPenalty()
  std::string initialisation = "torch";             ///< or "rlkit": see SacNetworks::initialise()

  // what a round does besides resetting parameters
  std::string targets_at_round = "keep";  ///< target critics: "keep", or "meta": the meta-policy's
  bool reset_moments = false;             ///< Adam's moments begin anew
  /// With one_hot and model: the first layers' column of a task's own entry is that task's alone,
  /// and aggregation takes it from there.
  bool own_column = true;

  /// While training, the networks are told the task's number.
  bool isTold() const { return task_encoding == "one_hot" || models() || hasHeads(); }
  bool infers() const { return task_encoding == "inference"; }     ///< with the context encoder
  bool hasHeads() const { return task_encoding == "multi_head"; }  ///< a last layer for each task
  bool models() const { return task_encoding == "model"; }         ///< with a TaskModel
};

/// Binds all of them below `prefix`, e.g. "sac.".
void bind(Settings& settings, const std::string& prefix, SacSettings& sac);

}  // namespace pmeta
