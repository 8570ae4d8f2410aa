#pragma once

#include <cstddef>

namespace pmeta {

/// Where a learner hands its gradients. What becomes of them (plain descent, Adam, a pull towards
/// auxiliary parameters) is the optimiser's business; a learner knows nothing of personalisation.
template <class Scalar>
class Optimizer {
 public:
  virtual ~Optimizer() = default;

  /// Moves parameters [offset, offset + n) given the objective's gradient there.
  virtual void apply(std::size_t offset, const Scalar* gradient, std::size_t n) = 0;
};

}  // namespace pmeta
