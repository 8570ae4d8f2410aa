#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/learn/task_model.h"
#include "pmeta_core/nn/aligned.h"

namespace pmeta {

/// Which task transitions are of, by Bayes' rule through a TaskModel. A hypothesis z is refuted by
/// how badly it predicts what happened, summed over transitions, in whose order it does not matter:
///
///     E(z) = sum over transitions and outputs k of
///                (f_k(x, z) - outcome_k)^2 / (2 max(e^v_k, least_variance))
///
///     w_j  ~ exp(-kappa E(e_j))
///
/// on the tasks trained on, e_j; the prior is uniform.
class TaskPosterior {
 public:
  /// Of no transition. `parameters` are the model's; they and the model must outlive this.
  TaskPosterior(const TaskModel& model, const TaskModelSettings& settings, const float* parameters);

  /// One more transition is known. Allocates nothing.
  void observe(const Transition& transition);

  /// Of each task trained on, summing up to 1.
  const std::vector<double>& weights() const { return weights_; }

  /// The z of least E, the first of equal ones; of no transition the mean of the tasks trained on.
  std::vector<float> best() const;

  /// Draws the number of a task trained on by its weight.
  std::size_t draw(Rng& rng) const;

  std::size_t tasks() const { return model_.taskInputs(); }  ///< that are trained on
  /// One z after another, those of the tasks trained on first; [hypotheses(), tasks()].
  const std::vector<float>& hypotheses() const { return hypotheses_; }
  /// E of each hypothesis.
  const std::vector<double>& energies() const { return energies_; }

 private:
  void weigh();

  const TaskModel& model_;
  const float* parameters_;
  double kappa_;
  bool observed_ = false;
  std::vector<float> hypotheses_;
  std::vector<double> energies_;
  std::vector<double> weights_;
  std::vector<double> precisions_;  // 1 / max(e^v, least_variance) of each output
  MlpWorkspace workspace_;
  AlignedFloats input_;  // [hypotheses, inputs]; z stays
  std::vector<float> outcome_;
};

}  // namespace pmeta
