#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/rng.h"

namespace pmeta {

/// A stochastic policy u ~ N(mu(s), diag sigma^2) in float64: mu is a multi-layer perceptron with
/// tanh hidden layers and a linear output, log sigma a free vector, which counts as ln 1e-6 where
/// it is less. What MAML and ProMP learn (Finn et al., 2017; Rothfuss et al., 2019).
///
/// It is small, and conjugate gradients on it lose their direction in float32. Derivatives of first
/// and second order are written out: R{x} is the derivative of x as the parameters move along a
/// direction (Pearlmutter, "Fast exact multiplication by the Hessian", 1994).
///
/// Parameters are a flat vector of the caller's: weights [out, in] row-major, then biases, layer by
/// layer, then log sigma. Matrices are row-major with one sample a row.
class GaussianMlp {
 public:
  /// Throws Error unless every size is positive.
  GaussianMlp(std::size_t inputs, const std::vector<int>& hidden, std::size_t actions);

  /// What a forward pass leaves for those behind it.
  struct Pass {
    std::size_t rows = 0;                          ///< of the batch
    std::vector<std::vector<double>> activations;  ///< input of each layer; then the mean
    const std::vector<double>& mean() const { return activations.back(); }  ///< [rows, actions]
  };

  /// R{.} of a Pass.
  struct Tangent {
    std::vector<std::vector<double>> activations;  ///< as those of the Pass
    const std::vector<double>& mean() const { return activations.back(); }  ///< [rows, actions]
  };

  /// Numbers of an observation.
  std::size_t inputs() const { return layers_.front().inputs; }
  /// Numbers of an action.
  std::size_t actions() const { return layers_.back().outputs; }
  std::size_t size() const { return size_; }  ///< number of parameters
  /// Where log sigma begins among the parameters.
  std::size_t logStdOffset() const { return size_ - actions(); }
  const std::vector<Block>& blocks() const { return blocks_; }  ///< "policy.layer0.weight", ...

  /// Weights from U(-b, b), b = sqrt(6 / (inputs + outputs)) (Glorot and Bengio, 2010), biases 0.
  void initialise(double* parameters, double log_std, Rng& rng) const;

  /// log sigma with its floor, [actions].
  std::vector<double> logStd(const double* parameters) const;

  /// mu of `observations` [rows, inputs].
  void forward(const double* parameters, const double* observations, std::size_t rows,
               Pass& pass) const;

  /// Gradient, summed over rows, of a loss whose gradients are `d_mean` [rows, actions] by the
  /// means and `d_log_std` [actions] by log sigma, into `gradient`, which is overwritten.
  void backward(const double* parameters, const Pass& pass, const std::vector<double>& d_mean,
                const std::vector<double>& d_log_std, double* gradient) const;

  /// R{forward()} along `direction` [size()].
  void forwardAlong(const double* parameters, const double* direction, const Pass& pass,
                    Tangent& tangent) const;

  /// R{backward()}: given R{d_mean} and R{d_log_std} too, the Hessian of the loss times the
  /// direction, into `product`.
  void backwardAlong(const double* parameters, const double* direction, const Pass& pass,
                     const Tangent& tangent, const std::vector<double>& d_mean,
                     const std::vector<double>& r_d_mean, const std::vector<double>& r_d_log_std,
                     double* product) const;

 private:
  struct Layer {
    std::size_t inputs, outputs, weight, bias;  // where its parameters begin
  };

  void storeLogStd(const double* parameters, const std::vector<double>& d_log_std,
                   double* gradient) const;

  std::vector<Layer> layers_;
  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

}  // namespace pmeta
