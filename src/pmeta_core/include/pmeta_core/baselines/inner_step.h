#pragma once

#include <vector>

#include "pmeta_core/baselines/surrogate.h"

namespace pmeta {

/// One task's episodes before and after the inner step.
struct InnerStepData {
  ActionData before;  ///< by theta
  ActionData after;   ///< by theta_i
};

/// theta - alpha * gradient of `kind` on `data` at theta, into `adapted`: MAML's inner step.
void innerStep(const GaussianMlp& policy, const ActionData& data, Surrogate kind, double alpha,
               const double* parameters, double* adapted);

/// What parameters theta of a policy are worth to tasks, each of which adapts them to
///
///     theta_i = theta - alpha * grad J_i(theta),
///
/// J_i a surrogate on its data before the step; with derivatives through that step, of second
/// order: by the chain rule a gradient g at theta_i is (I - alpha H_i) g at theta, H_i the Hessian
/// of J_i (Finn et al., "Model-Agnostic Meta-Learning", 2017). All are means over tasks.
class InnerStepObjective {
 public:
  /// All must outlive this.
  InnerStepObjective(const GaussianMlp& policy, const std::vector<InnerStepData>& tasks,
                     Surrogate inner, double alpha);

  /// Adapts `theta` [size], which must stay until the next call, to each task.
  void at(const double* theta);
  /// theta_i of a task, [size].
  const std::vector<double>& adapted(std::size_t task) const { return tasks_[task].adapted; }

  /// Of the data after the step, by theta_i.
  double loss(Surrogate kind, double clip = 0) const;
  /// Its gradient by theta, through the inner steps.
  void gradient(Surrogate kind, double* gradient, double clip = 0) const;
  /// Mean of KL(pi_old || pi_theta_i) there.
  double kl() const;
  /// Hessian of kl() by theta, where pi_old is pi_theta_i, times `direction` into `product`: in
  /// that place third derivatives vanish, and it is the mean of M_i G_i M_i, M_i = I - alpha H_i,
  /// G_i the Gauss-Newton matrix of the KL at theta_i.
  void klProduct(const double* direction, double* product) const;

  /// Mean of KL(pi_old || pi_theta) on the data before the step, by task, and its gradient.
  std::vector<double> innerKl() const;
  /// The gradient of its mean over tasks by theta.
  void innerKlGradient(double* gradient) const;

  /// r of a row of a task's data after the step.
  double ratio(std::size_t task, std::size_t row) const { return tasks_[task].after.ratio(row); }

 private:
  struct Task {
    PolicyOnData before, after;
    std::vector<double> adapted;
  };
  void throughStep(const Task& task, std::vector<double>& gradient) const;
  template <class Term>
  void mean(double* sum, const Term& term) const;

  const GaussianMlp& policy_;
  Surrogate inner_;
  double alpha_;
  std::vector<Task> tasks_;
};

}  // namespace pmeta
