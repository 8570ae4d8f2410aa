#pragma once

#include <cstddef>

#include "pmeta_core/learn/optimizer.h"

namespace pmeta {

/// Gradient descent that also pulls the personal parameters towards the auxiliary ones, and moves
/// those after them. Works on any flat parameters; with lambda = 0 it is plain SGD.
template <class Scalar>
class ProximalSgd : public Optimizer<Scalar> {
 public:
  /// `personal` and `auxiliary`: `size` scalars each, which must outlive the optimiser.
  ProximalSgd(Scalar* personal, Scalar* auxiliary, std::size_t size, double alpha, double lambda,
              double eta)
      : personal_(personal),
        auxiliary_(auxiliary),
        size_(size),
        alpha_(static_cast<Scalar>(alpha)),
        lambda_(static_cast<Scalar>(lambda)),
        eta_lambda_(static_cast<Scalar>(eta * lambda)) {}

  /// omega <- omega + eta * lambda * (phi - omega) on every parameter: eq. (local_update0).
  void moveAuxiliary() {
    for (std::size_t k = 0; k < size_; ++k) {
      auxiliary_[k] += eta_lambda_ * (personal_[k] - auxiliary_[k]);
    }
  }

 private:
  /// phi <- phi - alpha * (gradient + lambda * (phi - omega)): eq. (per_update0), which descends
  /// (the paper prints a plus; its appendix has the minus).
  void move(std::size_t offset, const Scalar* gradient, std::size_t n, Scalar* target,
            double tau) override {
    Scalar* phi = personal_ + offset;
    const Scalar* omega = auxiliary_ + offset;
    for (std::size_t k = 0; k < n; ++k) {
      phi[k] -= alpha_ * (gradient[k] + lambda_ * (phi[k] - omega[k]));
    }
    if (target == nullptr) return;
    for (std::size_t k = 0; k < n; ++k)
      target[k] += static_cast<Scalar>(tau) * (phi[k] - target[k]);
  }

  Scalar* personal_;
  Scalar* auxiliary_;
  std::size_t size_;
  Scalar alpha_;
  Scalar lambda_;
  Scalar eta_lambda_;
};

}  // namespace pmeta
