#pragma once

#include <memory>
#include <string>

#include "pmeta_core/env/sparse_point.h"

namespace pmeta::test {

/// A point robot that sees how far its goal is in every reward.
class DensePoint : public SparsePoint {
 public:
  using SparsePoint::SparsePoint;
  Step step(const double* action, Rng& rng, double* observation) override {
    Step step = SparsePoint::step(action, rng, observation);
    step.sparse_reward.reset();
    return step;
  }
};

/// Two tasks, with goals at (1, 0) and (-1, 0). The best return is -4.5; what has not found out
/// about its task cannot do better than -20 in the mean of both, since the distances add up to 2.
class TwoGoals : public EnvFamily {
 public:
  void bind(Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int task) const override { return "goal_" + std::to_string(task); }
  std::string taskDescription(int task) const override { return taskName(task); }
  std::unique_ptr<Env> make(int task) const override {
    return std::make_unique<DensePoint>(SparsePointTask{task == 0 ? 1.0 : -1.0, 0.0});
  }
};

}  // namespace pmeta::test
