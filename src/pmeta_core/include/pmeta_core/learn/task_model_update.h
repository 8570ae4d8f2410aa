#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/learn/task_model.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Fits a TaskModel to transitions of one task, whose z is known.
///
/// The network descends the sum over outputs of the mean squared error L_k; v_k that of
/// (L_k / e^v_k + v_k) / 2, and settles at ln L_k.
class TaskModelUpdate {
 public:
  /// `batch`: rows of one update. `z`: of the task. The model must outlive this.
  TaskModelUpdate(const TaskModel& model, std::size_t batch, const std::vector<float>& z);

  /// One update on rows drawn from `kept`, which holds one at least. `parameters` are the model's,
  /// which begin at `offset` of the optimiser's. Returns the sum over outputs of L_k. Allocates
  /// nothing.
  double apply(const float* parameters, const ReplayBuffer& kept, std::size_t offset,
               Optimizer<float>& optimizer, Rng& rng);

 private:
  const TaskModel& model_;
  std::size_t batch_;
  MlpWorkspace workspace_;
  AlignedFloats input_;     // [batch, inputs]; z stays
  AlignedFloats outcomes_;  // [batch, outputs]
  AlignedFloats d_outputs_;
  std::vector<double> losses_;  // L_k
  AlignedFloats gradient_;
};

}  // namespace pmeta
