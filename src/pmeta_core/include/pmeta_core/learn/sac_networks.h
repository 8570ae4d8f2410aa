#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/learn/task_model.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// The one-hot vector of `task` out of `num_tasks`. Throws Error if it is none of them.
std::vector<float> oneHot(int task, int num_tasks);

/// The networks of soft actor-critic, whose parameters lie in one flat vector as the blocks
/// "actor.*", "critic1.*", "critic2.*", with backbone "value" "value.*" and, with task_encoding
/// "inference", "encoder.*", or with "model" "task_model.*".
///
/// The actor takes [observation, task input] and gives the heads of a GaussianPolicy; a critic
/// takes [observation, task input, action], the value network what the actor takes. The task input
/// is the same in every row: the task's one-hot vector, the encoder's z, or nothing.
class SacNetworks {
 public:
  /// `num_tasks`: length of the one-hot vector, or of the task input that is given; ignored with
  /// other kinds of task_encoding. Throws Error if actions are discrete or there is no task to
  /// encode.
  SacNetworks(const EnvSpec& env, const SacSettings& settings, int num_tasks);

  const Mlp& actor() const { return actor_; }  ///< its outputs are the heads of a GaussianPolicy
  const Mlp& critic(int k) const { return k == 0 ? critic1_ : critic2_; }  ///< k: 0 or 1
  bool hasValue() const { return value_.has_value(); }         ///< with backbone "value"
  const Mlp& value() const { return *value_; }                 ///< only where hasValue()
  bool hasEncoder() const { return encoder_.has_value(); }     ///< with task_encoding "inference"
  const ContextEncoder& encoder() const { return *encoder_; }  ///< only where hasEncoder()

  /// Where critic k (0 or 1) begins; the actor is the first.
  std::size_t criticOffset(int k) const { return actor_.size() + (k == 0 ? 0 : critic1_.size()); }
  /// After both critics.
  std::size_t valueOffset() const { return criticOffset(1) + critic2_.size(); }
  /// After all others, whether there is an encoder or not.
  std::size_t encoderOffset() const { return valueOffset() + (hasValue() ? value_->size() : 0); }
  bool hasTaskModel() const { return task_model_.has_value(); }    ///< with task_encoding "model"
  const TaskModel& taskModel() const { return *task_model_; }      ///< only where hasTaskModel()
  std::size_t taskModelOffset() const { return encoderOffset(); }  ///< in the encoder's place
  std::size_t size() const;                                        ///< number of all parameters
  /// Where in the parameters the taskInputSize() weights of the task input begin, for every unit of
  /// the first layers of actor, critics and task model.
  std::vector<std::size_t> taskWeights() const;
  std::vector<Block> blocks() const;  ///< of all, in order

  std::size_t observationSize() const { return observation_size_; }  ///< numbers of an observation
  /// Length of the one-hot vector or of z; 0 without either.
  std::size_t taskInputSize() const { return task_input_size_; }
  std::size_t actionSize() const { return action_size_; }  ///< numbers of an action
  float minLogStd() const { return min_log_std_; }         ///< of the actor's GaussianPolicy

  /// Each network as Mlp::initialise() does. With initialisation "rlkit" as the library of that
  /// name, with which PEARL was released: hidden weights from U(-b, b), b = 1 / sqrt(outputs of the
  /// layer), hidden biases 0.1, and the last layer from U(-0.003, 0.003), the actor's a third of
  /// it. With a task model the weights of the task input are 0 in all networks, so that tasks
  /// part only where they must, and those between two of them make sense.
  void initialise(float* parameters, Rng& rng) const;

 private:
  std::size_t observation_size_;
  std::size_t action_size_;
  std::size_t task_input_size_;
  float min_log_std_;
  bool as_rlkit_;
  Mlp actor_, critic1_, critic2_;
  std::optional<Mlp> value_;
  std::optional<ContextEncoder> encoder_;
  std::optional<TaskModel> task_model_;
};

/// Policies of those networks: tanh(mean) of the actor.
class SacPolicies : public PolicyFamily {
 public:
  /// As SacNetworks.
  SacPolicies(const EnvSpec& env, const SacSettings& settings, int num_tasks);

  /// All of them, also the encoder, which does not act itself.
  const SacNetworks& networks() const { return networks_; }

  /// ReLU between layers; means squashed by tanh.
  PolicyForm form() const override;
  std::size_t taskInputSize() const override { return networks_.taskInputSize(); }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  SacNetworks networks_;
};

}  // namespace pmeta
