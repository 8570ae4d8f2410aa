#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/baselines/metacure_settings.h"
#include "pmeta_core/env/env_spec.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/personal/proximal_adam.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Squared error of a predicted reward, the first number, plus the mean of those of the next
/// observation's components, the others, if there are any.
template <class Scalar>
double predictionError(const Scalar* predicted, const Scalar* seen, std::size_t size) {
  double error = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double difference = static_cast<double>(predicted[i]) - static_cast<double>(seen[i]);
    error += difference * difference / (i == 0 ? 1 : static_cast<double>(size - 1));
  }
  return error;
}

/// What a step tells of the task, as MetaCURE's explorer is rewarded for it: by how much the error
/// of what a belief foretells of it exceeds the error of what knowing the task does,
///
///     [r^(b, s, a) - r]^2 - [r^_i(s, a) - r]^2   (and the same for s')
///
/// Of the two networks one takes the belief and one the task's one-hot vector beside s and a. They
/// serve training alone and are no part of a policy.
class InformationGain {
 public:
  /// What an update gave.
  struct Losses {
    double by_belief = 0;  ///< mean of predictionError()
    double by_task = 0;    ///< the same
  };

  /// For batches of meta_batch * task_batch steps.
  InformationGain(const EnvSpec& env, int num_tasks, const MetaCureSettings& settings);

  /// To be called before the first update.
  void initialise(Rng& rng);

  /// Takes a step on `task` as the row-th of the batch; `belief` before it.
  void put(std::size_t row, const Transition& step, const float* belief, std::size_t task);

  /// A step of Adam on both.
  Losses learn();

  /// Of each row.
  const std::vector<float>& gains();

  /// Parameters and moments.
  void saveState(StateWriter& writer) const;
  /// The same.
  void loadState(StateReader& reader);

 private:
  struct Predictor {
    Predictor(MlpSpec spec, std::size_t batch, double learning_rate);
    const float* predict() { return network.forward(parameters.data(), inputs.data(), rows, work); }
    double learn(const AlignedFloats& seen);

    Mlp network;
    std::size_t rows;
    AlignedFloats parameters, gradient, inputs, d_outputs;
    MlpWorkspace work;
    ProximalAdam adam;
  };

  std::size_t outputs_;
  std::size_t belief_size_, num_tasks_, observation_size_, action_size_;
  Predictor by_belief_, by_task_;
  AlignedFloats seen_;  // rewards, and next observations
  std::vector<float> gains_;
};

}  // namespace pmeta
