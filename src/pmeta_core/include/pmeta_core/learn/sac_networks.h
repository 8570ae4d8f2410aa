#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// The one-hot vector of `task` out of `num_tasks`. Throws Error if it is none of them.
std::vector<float> oneHot(int task, int num_tasks);

/// The networks of soft actor-critic, whose parameters lie in one flat vector as the blocks
/// "actor.*", "critic1.*", "critic2.*" and, with task_encoding "inference", "encoder.*".
///
/// The actor takes [observation, task input] and gives the heads of a GaussianPolicy; a critic
/// takes [observation, task input, action]. The task input is the same in every row: the task's
/// one-hot vector, the encoder's z, or nothing.
class SacNetworks {
 public:
  /// `num_tasks`: length of the one-hot vector; ignored unless task_encoding is "one_hot". Throws
  /// Error if actions are discrete or there is no task to encode.
  SacNetworks(const EnvSpec& env, const SacSettings& settings, int num_tasks);

  const Mlp& actor() const { return actor_; }  ///< its outputs are the heads of a GaussianPolicy
  const Mlp& critic(int k) const { return k == 0 ? critic1_ : critic2_; }  ///< k: 0 or 1
  bool hasEncoder() const { return encoder_.has_value(); }     ///< with task_encoding "inference"
  const ContextEncoder& encoder() const { return *encoder_; }  ///< only where hasEncoder()

  /// Where critic k (0 or 1) begins; the actor is the first.
  std::size_t criticOffset(int k) const { return actor_.size() + (k == 0 ? 0 : critic1_.size()); }
  /// After both critics, whether there is an encoder or not.
  std::size_t encoderOffset() const { return criticOffset(1) + critic2_.size(); }
  std::size_t size() const;           ///< number of all parameters
  std::vector<Block> blocks() const;  ///< of all, in order

  std::size_t observationSize() const { return observation_size_; }  ///< numbers of an observation
  /// Length of the one-hot vector or of z; 0 without either.
  std::size_t taskInputSize() const { return task_input_size_; }
  std::size_t actionSize() const { return action_size_; }  ///< numbers of an action

  /// Each network as Mlp::initialise() does.
  void initialise(float* parameters, Rng& rng) const;

 private:
  std::size_t observation_size_;
  std::size_t action_size_;
  std::size_t task_input_size_;
  Mlp actor_, critic1_, critic2_;
  std::optional<ContextEncoder> encoder_;
};

/// Policies of those networks: tanh(mean) of the actor.
class SacPolicies : public PolicyFamily {
 public:
  /// As SacNetworks.
  SacPolicies(const EnvSpec& env, const SacSettings& settings, int num_tasks);

  /// All of them, also the encoder, which does not act itself.
  const SacNetworks& networks() const { return networks_; }

  /// ReLU between layers; means squashed by tanh.
  PolicyForm form() const override { return {"relu", "tanh"}; }
  std::size_t taskInputSize() const override { return networks_.taskInputSize(); }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  SacNetworks networks_;
};

}  // namespace pmeta
