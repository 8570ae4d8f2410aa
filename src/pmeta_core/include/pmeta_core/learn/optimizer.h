#pragma once

#include <cstddef>

namespace pmeta {

/// Where a learner hands its gradients. What becomes of them (plain descent, Adam, a pull towards
/// auxiliary parameters) is the optimiser's business; a learner knows nothing of personalisation.
template <class Scalar>
class Optimizer {
 public:
  virtual ~Optimizer() = default;

  /// Moves parameters phi [offset, offset + n) given the objective's gradient there. Where `target`
  /// (n scalars, not among the parameters) is not null, it follows what has moved, in the same
  /// pass: target[k] += tau (phi'[k] - target[k]), tau in (0, 1]: Polyak averaging.
  void apply(std::size_t offset, const Scalar* gradient, std::size_t n, Scalar* target = nullptr,
             double tau = 0) {
    move(offset, gradient, n, target, tau);
  }

 protected:
  /// apply(), as each optimiser does it.
  virtual void move(std::size_t offset, const Scalar* gradient, std::size_t n, Scalar* target,
                    double tau) = 0;
};

}  // namespace pmeta
