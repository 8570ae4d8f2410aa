#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// What sets one mountain car apart.
struct MountainCarTask {
  double zeta = 3;          ///< frequency of the hills: the slope goes with cos(zeta * position)
  double force = 0.001;     ///< speed that a push adds
  double gravity = 0.0025;  ///< speed that the steepest slope adds
};

/// MountainCar-v0 of Gym with hills of any frequency: swing up to position 0.5 by pushing left (0),
/// not at all (1) or right (2).
///
/// State: position in [-1.2, 0.6], velocity in [-0.07, 0.07] a step. Observation: position, and
/// velocity times `velocity_scale`, a fixed scaling for learners that want inputs of like size. The
/// reward is -1 each step, also for the one that reaches the goal and so terminates. Truncated
/// after 200 steps. Episodes start at rest, uniformly in [-0.6, -0.4].
class MountainCar : public Env {
 public:
  /// A car in those hills; `velocity_scale`, positive, is for observations alone.
  explicit MountainCar(const MountainCarTask& task, double velocity_scale = 1);

  /// Position and scaled velocity with their bounds, and the three pushes.
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;
  std::vector<double> state() const override;  ///< position, velocity (never scaled), steps
  void setState(const std::vector<double>& state) override;

  const MountainCarTask& task() const { return task_; }  ///< as given to the constructor

 private:
  void observe(double* observation) const;

  MountainCarTask task_;
  double velocity_scale_;
  EnvSpec spec_;
  double position_ = 0;
  double velocity_ = 0;
  int steps_ = 0;
};

/// Mountain cars that differ in their hills, by default the paper's five; or in force and gravity.
class MountainCarFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(tasks_.size()); }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Throws std::out_of_range if there is no such task.
  const MountainCarTask& task(int task) const { return tasks_.at(task); }
  double velocityScale() const { return velocity_scale_; }  ///< of observations

 private:
  std::vector<double> zeta_ = {3, 3.5, 4, 4.5, 5};
  std::vector<double> force_ = {0.001};
  std::vector<double> gravity_ = {0.0025};
  double velocity_scale_ = 1;
  std::vector<MountainCarTask> tasks_;
};

}  // namespace pmeta
