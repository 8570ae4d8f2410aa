#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// What sets one point robot apart: where it is to go.
struct SparsePointTask {
  double goal_x = 1;  ///< on the unit half circle where the family makes it
  double goal_y = 0;  ///< at least 0 where the family makes it
};

/// Sparse-Point-Robot: a point in the plane goes to a goal that it sees only in its reward (Rakelly
/// et al., 2019).
///
/// State and observation: position x, y. An action (2 numbers, clipped to [-1, 1]) moves it by a
/// tenth of itself. Training is on the dense reward -d, d the distance to the goal after the move;
/// Step::sparse_reward is 1 - d within `goal_radius` of the goal and 0 beyond. Never terminates.
/// Episodes start at the origin.
class SparsePoint : public Env {
 public:
  /// `goal_radius`: within which the sparse reward is not 0; `horizon`: steps of an episode.
  explicit SparsePoint(const SparsePointTask& task, double goal_radius = 0.2, int horizon = 20);

  const EnvSpec& spec() const override { return spec_; }  ///< position and move, with bounds
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;
  std::vector<double> state() const override;  ///< x, y, steps
  void setState(const std::vector<double>& state) override;

  const SparsePointTask& task() const { return task_; }  ///< as given to the constructor

 private:
  SparsePointTask task_;
  double goal_radius_;
  EnvSpec spec_;
  double x_ = 0;
  double y_ = 0;
  int steps_ = 0;
};

/// Point robots with goals on the unit half circle: by default ten for training, evenly spaced with
/// both ends, and three for test, drawn uniformly.
class SparsePointFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return num_train_; }
  int numTestTasks() const override { return static_cast<int>(tasks_.size()) - num_train_; }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Goal of a training or test task; throws std::out_of_range if there is none.
  const SparsePointTask& task(int task) const { return tasks_.at(task).goal; }
  /// Of all tasks: distance within which the sparse reward is not 0.
  double goalRadius() const { return goal_radius_; }

 private:
  struct Task {
    double angle;
    SparsePointTask goal;
  };
  std::vector<double> goal_angles_;
  std::vector<double> test_goal_angles_;
  int train_tasks_ = 10;
  int test_tasks_ = 3;
  double goal_radius_ = 0.2;
  int horizon_ = 20;
  std::vector<Task> tasks_;
  int num_train_ = 0;
};

}  // namespace pmeta
