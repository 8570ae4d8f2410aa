#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/env/mujoco_env.h"

namespace pmeta {

/// What sets one walker apart: factors on figures of the base model, row by row.
struct Walker2dTask {
  std::vector<double> body_mass;      ///< one for each body, the world included
  std::vector<double> body_inertia;   ///< three for each body
  std::vector<double> dof_damping;    ///< one for each degree of freedom
  std::vector<double> geom_friction;  ///< three for each geom, the floor included
};

/// Draws a task of Walker-2D-Params: independent factors b^u, u uniform in [-3, 3], with b = 1.3
/// for damping and 1.5 for all else, in the order of Walker2dTask.
Walker2dTask drawWalker2dTask(const MujocoModel& base, Rng& rng);

/// A copy of the base model with that task's figures. What MuJoCo derives from them when it
/// compiles a model (the inverse weights of its constraint solver) stays the base model's, as in
/// the original. Throws Error unless each list has as many factors as the model has figures.
std::shared_ptr<const MujocoModel> applyWalker2dTask(const MujocoModel& base,
                                                     const Walker2dTask& task);

/// What a person would ask of such a model first, e.g. "31.2 kg of 23.7 kg, friction of the feet
/// 0.5 and 2.1".
std::string describeWalker2dModel(const MujocoModel& model, const MujocoModel& base);

/// Walker-2D-Params: a planar biped with six motors walks forward (Rothfuss et al., 2019, in the
/// version of Rakelly et al., 2019); tasks differ in the model.
///
/// A step takes 4 timesteps of 0.004 s. The reward is the forward velocity (m/s, mean over the
/// step)
/// + 1 - 0.001 |a|^2. Terminates unless the height is in (0.8, 2) and the pitch in (-1, 1).
/// Episodes start with uniform noise in [-0.005, 0.005] on all coordinates and velocities.
///
/// Observation (17): height, pitch, angles of thigh, leg and foot, right then left, and the nine
/// velocities (x, z, pitch, joints) clipped to [-10, 10].
class Walker2d : public MujocoEnv {
 public:
  /// Episodes are of `horizon` steps. The model must have layout(), as MujocoModel::open() sees to.
  explicit Walker2d(std::shared_ptr<const MujocoModel> model, int horizon = 200);

  /// What the model must have; its shipped name is "walker2d".
  static const MujocoLayout& layout();

  double forwardVelocity() const { return forward_velocity_; }  ///< of the last step, m/s
  double controlCost() const { return control_cost_; }          ///< of the last step
  static double aliveBonus() { return 1; }  ///< what the reward adds in every step

 private:
  void drawStart(Rng& rng, double* qpos, double* qvel) override;
  void beforeStep() override;
  Step afterStep() override;
  void observe(double* observation) const override;
  static std::vector<Quantity> observed();

  double x_before_ = 0;
  double forward_velocity_ = 0;
  double control_cost_ = 0;
};

/// Walkers with randomised models: by default ten for training, three for test.
///
/// Each task is drawn from a seed of its own, which the description names; the same seed given as a
/// setting is the same task.
class Walker2dParamsFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return num_train_; }
  int numTestTasks() const override { return static_cast<int>(tasks_.size()) - num_train_; }
  ModelChoice* model() override { return &mujoco_.model; }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Factors of a training or test task; throws std::out_of_range if there is none.
  const Walker2dTask& task(int task) const { return tasks_.at(task).factors; }

 private:
  struct Task {
    int seed;
    Walker2dTask factors;
    std::shared_ptr<const MujocoModel> model;
  };
  MujocoSettings mujoco_;
  std::vector<int> task_seeds_;
  std::vector<int> test_task_seeds_;
  int train_tasks_ = 10;
  int test_tasks_ = 3;
  std::shared_ptr<const MujocoModel> base_;
  std::vector<Task> tasks_;
  int num_train_ = 0;
};

}  // namespace pmeta
