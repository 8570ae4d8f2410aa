#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Settings of inference by a learnt model of what sets tasks apart.
struct TaskModelSettings {
  std::vector<int> hidden = {64, 64};  ///< units of each hidden layer of the model
  /// It predicts the next observation as well as the reward; for tasks that differ in dynamics.
  bool dynamics = false;
  int buffer_size = 100000;  ///< recent transitions of the task that it learns from
  /// In training, in every how-many-th episode the explorer acts, on the number of a task drawn
  /// from all that are trained on; 0: in none.
  int exploring_interval = 5;
  bool explored_to_replay = false;  ///< such episodes are for actor and critics, too
  double kappa =
      0.1;  ///< weight of a transition's likelihood: consecutive ones are not independent
  double least_variance = 0.01;  ///< of a prediction's error, however well the model fits
  /// What a task may be once it has been explored: "vertices", one of those trained on, or
  /// "mixtures", also a quarter, a half or three quarters of the way between two of them.
  std::string hypotheses = "vertices";
};

/// Binds all of them below `prefix`, e.g. "sac.task_model.".
void bind(Settings& settings, const std::string& prefix, TaskModelSettings& model);

/// What a transition gives on task z: a network that predicts the reward and, with
/// settings.dynamics, the change of the observation, each as the mean of a Gaussian whose variance
/// e^v is the same for all transitions:
///
///     reward            r       ~ N(f(x, z), e^v),   x = [symlog(s), a, symlog(20 (s' - s))]
///     with dynamics    (r, d)   ~ N(f(x, z), e^v),   x = [symlog(s), a],  d = symlog(20 (s' - s))
///
/// with symlog(x) = sign(x) ln(1 + |x|) (Hafner et al., 2023). Unlike q(z|c), which one task alone
/// would teach that all transitions are its own, this is learnt on each task for its own z without
/// a word on other z; Bayes' rule then gives q(z|c), see TaskPosterior.
///
/// Parameters belong to the caller: blocks "task_model.*", the last of which is v.
class TaskModel {
 public:
  /// `task_inputs`: numbers of z. Throws Error where Mlp does.
  TaskModel(int observation_size, int action_size, std::size_t task_inputs,
            const TaskModelSettings& settings, bool portable);

  const Mlp& network() const { return network_; }             ///< of [x, z]
  std::size_t outputs() const { return network_.outputs(); }  ///< numbers that are predicted
  std::size_t taskInputs() const { return task_inputs_; }     ///< numbers of z
  /// Numbers of x, which z follows.
  std::size_t rowSize() const { return network_.inputs() - task_inputs_; }
  /// Parameters: the network's, then v, [outputs()].
  std::size_t size() const { return network_.size() + outputs(); }
  std::vector<Block> blocks() const;  ///< of all, in order

  /// The network as Mlp::initialise() does; v = 0.
  void initialise(float* parameters, Rng& rng) const;

  /// Writes x, rowSize() floats, and what came of it, outputs() floats.
  void write(const Transition& transition, float* row, float* outcome) const;

 private:
  std::size_t observation_size_;
  std::size_t action_size_;
  std::size_t task_inputs_;
  bool dynamics_;
  Mlp network_;
};

}  // namespace pmeta
