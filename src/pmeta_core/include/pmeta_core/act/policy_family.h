#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/base/model.h"

namespace pmeta {

/// All policies of one form: what their parameters are, and how they act.
class PolicyFamily {
 public:
  explicit PolicyFamily(ModelLayout layout) : layout_(std::move(layout)) {}
  virtual ~PolicyFamily() = default;

  const ModelLayout& layout() const { return layout_; }

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
