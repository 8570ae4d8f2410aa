#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/base/model.h"

namespace pmeta {

/// What acts between a policy's parameters, by names that any program can go by.
struct PolicyForm {
  std::string hidden_activation;        ///< of hidden layers: "relu"; "none" for a table
  std::string output_squashing;         ///< "tanh": outputs lie in (-1, 1), or "none"
  std::string network;                  ///< first part of the acting network's blocks' names; empty
                                        ///< where that is not layers alone
  std::string input_scaling = "none";   ///< of observations, before the first layer
  std::string output_scaling = "none";  ///< of actions, after the squashing
  std::size_t heads = 1;                ///< see MlpSpec
};

/// All policies of one form: what their parameters are, and how they act.
class PolicyFamily {
 public:
  /// `layout`: of the parameters of every policy.
  explicit PolicyFamily(ModelLayout layout) : layout_(std::move(layout)) {}
  virtual ~PolicyFamily() = default;

  const ModelLayout& layout() const { return layout_; }  ///< of the parameters of every policy

  virtual PolicyForm form() const = 0;  ///< activations, squashing and scaling, for policy files

  /// How many numbers tell a policy its task beside the observation.
  virtual std::size_t taskInputSize() const = 0;

  /// Writes parameters to begin with.
  virtual void initialise(Model& parameters, Rng& rng) const = 0;

  /// Acts greedily in up to `max_batch` environments at once, by parameters that may change but
  /// must outlive it, as the family must. `task_input`: taskInputSize() numbers.
  virtual std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                                       std::size_t max_batch) const = 0;

 private:
  ModelLayout layout_;
};

}  // namespace pmeta
