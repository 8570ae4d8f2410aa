#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// Acts by the largest output of a network of action values; the lowest index wins a tie.
class QActor : public Actor {
 public:
  /// In up to `max_batch` environments at once. The network must outlive the actor, as
  /// `parameters` must; nullptr: to be given by use() before it acts.
  QActor(const Mlp& network, std::size_t max_batch, const float* parameters = nullptr);

  /// Acts by these from now on; they must outlive that.
  void use(const float* parameters) { parameters_ = parameters; }

  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;

 private:
  const Mlp& network_;
  MlpWorkspace workspace_;
  const float* parameters_;
  const float* values_ = nullptr;  // [envs, actions]
};

/// Greedy policies of a network of action values (float32).
class QPolicies : public PolicyFamily {
 public:
  explicit QPolicies(const MlpSpec& network);  ///< throws Error where Mlp does

  /// One input row is an observation, one output the value of an action.
  const Mlp& network() const { return network_; }

  /// ReLU between layers; outputs are values as they are.
  PolicyForm form() const override { return {"relu", "none", network_.spec().prefix}; }
  std::size_t taskInputSize() const override { return 0; }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  Mlp network_;
};

}  // namespace pmeta
