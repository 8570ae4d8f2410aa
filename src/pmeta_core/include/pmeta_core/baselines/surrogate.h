#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/baselines/gaussian_mlp.h"

namespace pmeta {

/// What a policy did in the episodes of one task, one step a row, and how it turned out.
struct ActionData {
  std::size_t rows = 0;              ///< steps of all its episodes
  std::vector<double> observations;  ///< [rows, inputs]
  std::vector<double> actions;       ///< u as it was drawn, [rows, actions]
  std::vector<double> advantages;    ///< [rows]
  // of the policy that acted
  std::vector<double> old_mean;      ///< [rows, actions]
  std::vector<double> old_log_std;   ///< [actions]
  std::vector<double> old_log_prob;  ///< [rows]
};

/// log N(u; mean, diag exp(log_std)^2) of one row.
double logProbability(const double* u, const double* mean, const std::vector<double>& log_std);

/// Measures of a policy on given data, each a mean over its rows, with their derivatives by its
/// parameters. With x = log pi(u|s), r = pi(u|s) / pi_old(u|s), A the advantage:
enum class Surrogate {
  kLogLikelihood,  ///< - mean x A
  kRatio,          ///< - mean r A, whose Hessian at pi = pi_old is that of the expected return
  kClippedRatio,   ///< - mean min(r A, clip(r, 1 - clip, 1 + clip) A): PPO's
};

/// One policy's pass over one task's data, from which losses and derivatives are taken.
class PolicyOnData {
 public:
  /// Both must outlive this.
  PolicyOnData(const GaussianMlp& policy, const ActionData& data);

  /// Evaluates the policy of `parameters`, which must stay until the next call.
  void at(const double* parameters);

  /// `clip`: of kClippedRatio alone.
  double loss(Surrogate kind, double clip = 0) const;
  /// Its gradient [size] into `gradient`.
  void gradient(Surrogate kind, double* gradient, double clip = 0) const;
  /// Its Hessian times `direction` [size] into `product`; of kLogLikelihood and kRatio.
  void hessianProduct(Surrogate kind, const double* direction, double* product) const;

  /// Mean of KL(pi_old || pi).
  double kl() const;
  /// Its gradient [size] into `gradient`.
  void klGradient(double* gradient) const;
  /// The Gauss-Newton matrix of that KL times `direction` into `product`: its Hessian where pi is
  /// pi_old.
  void klProduct(const double* direction, double* product) const;

  /// r of a row.
  double ratio(std::size_t row) const;

 private:
  // derivatives of log pi of a row by mu and log sigma
  struct Heads {
    std::vector<double> mean, log_std;
  };
  void headsOf(std::size_t row, Heads& heads) const;
  double logProb(std::size_t row) const;
  /// d loss / d log pi of a row.
  double weight(Surrogate kind, std::size_t row, double clip) const;

  const GaussianMlp& policy_;
  const ActionData& data_;
  const double* parameters_ = nullptr;
  std::vector<double> log_std_;
  GaussianMlp::Pass pass_;
};

}  // namespace pmeta
