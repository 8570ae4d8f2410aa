#pragma once

#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/act/gaussian_policy.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// Acts by a network whose input is the observation and a task input, the same in every row, and
/// whose output are the heads of a GaussianPolicy.
class GaussianActor : public Actor {
 public:
  /// `kMean`: tanh(mean), which draws nothing.
  enum class By { kMean, kSample };

  /// In up to `max_batch` environments at once. The network must outlive the actor, as
  /// `parameters` must; nullptr: to be given by use() before it acts.
  GaussianActor(const Mlp& network, std::vector<float> task_input, std::size_t max_batch, By by,
                const float* parameters = nullptr);

  /// Acts by these from now on; they must outlive that.
  void use(const float* parameters) { parameters_ = parameters; }

  /// May be written to, not resized.
  std::vector<float>& taskInput() { return task_input_; }
  /// The numbers that follow the observation in each input row.
  const std::vector<float>& taskInput() const { return task_input_; }

  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;

 private:
  const Mlp& network_;
  std::vector<float> task_input_;
  By by_;
  const float* parameters_;
  MlpWorkspace workspace_;
  AlignedFloats input_;  // [max_batch, inputs]
  GaussianPolicy policy_;
  const float* heads_ = nullptr;
};

}  // namespace pmeta
