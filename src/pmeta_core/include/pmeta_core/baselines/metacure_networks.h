#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/baselines/belief_encoder.h"
#include "pmeta_core/baselines/metacure_settings.h"
#include "pmeta_core/learn/sac_networks.h"

namespace pmeta {

/// What MetaCURE acts by: two soft actor-critics over one encoder. Flat parameters: those of the
/// exploiter, whose task input is z; of the explorer, with "explorer_" before their names, whose
/// task input is a belief; and the encoder's.
class MetaCureNetworks {
 public:
  /// Throws Error where actions are discrete.
  MetaCureNetworks(const EnvSpec& env, const MetaCureSettings& settings);

  const SacNetworks& exploiter() const { return exploiter_; }  ///< its parameters begin at 0
  /// On beliefs.
  const SacNetworks& explorer() const { return explorer_; }
  /// Of trials.
  const BeliefEncoder& encoder() const { return encoder_; }

  /// Where the explorer's parameters begin.
  std::size_t explorerOffset() const { return exploiter_.size(); }
  /// Where the encoder's begin.
  std::size_t encoderOffset() const { return explorerOffset() + explorer_.size(); }
  std::size_t size() const { return encoderOffset() + encoder_.size(); }  ///< of all parameters
  std::vector<Block> blocks() const;                                      ///< of all, in order
  /// Each network as its class does it.
  void initialise(float* parameters, Rng& rng) const;

 private:
  SacNetworks exploiter_, explorer_;
  BeliefEncoder encoder_;
};

/// Policies of those networks: the exploiter, told a z.
class MetaCurePolicies : public PolicyFamily {
 public:
  /// As MetaCureNetworks.
  MetaCurePolicies(const EnvSpec& env, const MetaCureSettings& settings);

  /// What the parameters are of.
  const MetaCureNetworks& networks() const { return networks_; }

  PolicyForm form() const override {
    return {"relu", "tanh", networks_.exploiter().actor().spec().prefix};
  }
  std::size_t taskInputSize() const override { return networks_.exploiter().taskInputSize(); }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  MetaCureNetworks networks_;
};

}  // namespace pmeta
