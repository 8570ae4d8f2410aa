#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/env/mujoco_env.h"

namespace pmeta {

/// What sets one half-cheetah apart.
struct HalfCheetahTask {
  /// What the reward asks for, and what `value` means.
  enum class Goal {
    kDirection,  ///< run as fast as possible; value is +1 (forward) or -1 (backward)
    kVelocity,   ///< run at a velocity; value is in m/s
  };
  Goal goal = Goal::kDirection;  ///< of the family: all its tasks have the same
  double value = 1;              ///< direction (1 or -1) or velocity (m/s), as `goal` says
};

/// Half-Cheetah-Dir and Half-Cheetah-Vel: a planar runner with six motors (Finn, Abbeel and Levine,
/// 2017, in the version of Rakelly et al., 2019).
///
/// A step takes 5 timesteps of 0.01 s. With forward velocity u (m/s, mean over the step) and
/// c = 0.05 |a|^2 the reward is value * u - c, or -|u - value| - c. Never terminates. Episodes
/// start with uniform noise in [-0.1, 0.1] on all nine coordinates and normal noise of deviation
/// 0.1 on all velocities.
///
/// Observation (20, rounded to single precision): height, pitch, six joint angles (hind thigh,
/// shin, foot, then front), velocities of all nine (x, z, pitch, joints), position of the torso x,
/// y, z as the last step left it.
class HalfCheetah : public MujocoEnv {
 public:
  /// Episodes are of `horizon` steps. The model must have layout(), as MujocoModel::open() sees to.
  HalfCheetah(const HalfCheetahTask& task, std::shared_ptr<const MujocoModel> model,
              int horizon = 200);

  /// What the model must have; its shipped name is "half_cheetah".
  static const MujocoLayout& layout();

  /// The reward of `task` at forward velocity u and control cost c.
  static double reward(const HalfCheetahTask& task, double forward_velocity, double control_cost);

  const HalfCheetahTask& task() const { return task_; }         ///< as given to the constructor
  double forwardVelocity() const { return forward_velocity_; }  ///< of the last step, m/s
  double controlCost() const { return control_cost_; }          ///< of the last step

 private:
  void drawStart(Rng& rng, double* qpos, double* qvel) override;
  void beforeStep() override;
  Step afterStep() override;
  void observe(double* observation) const override;
  static std::vector<Quantity> observed();

  HalfCheetahTask task_;
  double x_before_ = 0;
  double forward_velocity_ = 0;
  double control_cost_ = 0;
};

/// What both families of half-cheetahs have in common: training tasks, then test tasks.
class HalfCheetahFamily : public EnvFamily {
 public:
  int numTasks() const override { return num_train_; }
  int numTestTasks() const override { return static_cast<int>(tasks_.size()) - num_train_; }
  ModelChoice* model() override { return &mujoco_.model; }
  std::string taskName(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// A training or test task; throws std::out_of_range if there is none.
  const HalfCheetahTask& task(int task) const { return tasks_.at(task); }

 protected:
  /// Loads the model and takes up the values of the tasks.
  void build(HalfCheetahTask::Goal goal, const std::vector<double>& train,
             const std::vector<double>& test);

  MujocoSettings mujoco_;  ///< bound by both families alike

 private:
  std::shared_ptr<const MujocoModel> model_;
  std::vector<HalfCheetahTask> tasks_;
  int num_train_ = 0;
};

/// Forward and backward: by default two tasks, the same two for test.
class HalfCheetahDirFamily : public HalfCheetahFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  std::string taskDescription(int task) const override;

 private:
  std::vector<double> directions_ = {-1, 1};
  std::vector<double> test_directions_ = {-1, 1};
};

/// Target velocities, by default drawn uniformly from [0, 3] m/s: ten for training, three for test.
class HalfCheetahVelFamily : public HalfCheetahFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  std::string taskDescription(int task) const override;

 private:
  std::vector<double> velocities_;
  std::vector<double> test_velocities_;
  int train_tasks_ = 10;
  int test_tasks_ = 3;
};

}  // namespace pmeta
