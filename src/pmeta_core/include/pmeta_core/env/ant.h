#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/env/mujoco_env.h"

namespace pmeta {

/// What the reward of an ant's step is made of.
struct AntStep {
  double velocity_x = 0;    ///< of the torso, m/s
  double velocity_y = 0;    ///< of the torso, m/s
  double control_cost = 0;  ///< 0.5 |a|^2, subtracted
  double contact_cost = 0;  ///< 0.0005 |clip(f, -1, 1)|^2, subtracted
  double survive = 0;       ///< added in every step: 1
};

/// Ant-Fwd-Back: a four-legged body with eight motors runs in a direction (Finn, Abbeel and Levine,
/// 2017, in the version of Rakelly et al., 2019).
///
/// A step takes 5 timesteps of 0.01 s. The reward is w_x cos g + w_y sin g - 0.5 |a|^2 -
/// 0.0005 |clip(f, -1, 1)|^2 + 1: w is the velocity of the torso (m/s, from its positions as the
/// steps left them), g the direction, f the external contact forces on all bodies. Terminates where
/// the torso's height is not in [0.2, 1]. Episodes start with uniform noise in [-0.1, 0.1] on all
/// 15 coordinates, quaternion included, and normal noise of deviation 0.1 on all velocities.
///
/// Observation (27): height of the torso, its quaternion w, x, y, z, joint angles (hip and ankle of
/// legs 1 to 4), linear velocity (world axes), angular velocity (body axes), joint velocities.
/// Action (8): hip and ankle of legs 4, 1, 2, 3.
class Ant : public MujocoEnv {
 public:
  /// `direction`: angle in the plane, rad, 0 along x.
  Ant(double direction, std::shared_ptr<const MujocoModel> model, int horizon = 200);

  /// What the model must have; its shipped name is "ant".
  static const MujocoLayout& layout();

  /// The reward of an ant that is to run in `direction`.
  static double reward(double direction, const AntStep& step);

  double direction() const { return direction_; }    ///< the angle given to the constructor, rad
  const AntStep& lastStep() const { return last_; }  ///< what the last step's reward was made of

 private:
  void drawStart(Rng& rng, double* qpos, double* qvel) override;
  void beforeStep() override;
  Step afterStep() override;
  void observe(double* observation) const override;
  double contactCost() const;
  static std::vector<Quantity> observed();

  double direction_;
  int contact_numbers_;  ///< how many there are, of all bodies
  std::array<double, 2> before_{};
  AntStep last_;
};

/// Ants that run in different directions: by default forward and backward, the same two for test.
class AntFwdBackFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(angles_.size()); }
  int numTestTasks() const override { return static_cast<int>(test_angles_.size()); }
  ModelChoice* model() override { return &mujoco_.model; }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Direction of a training or test task, rad; throws std::out_of_range if there is none.
  double angle(int task) const { return tasks_.at(task); }

 private:
  MujocoSettings mujoco_;
  std::vector<double> angles_ = {0, 3.141592653589793};
  std::vector<double> test_angles_ = {0, 3.141592653589793};
  std::shared_ptr<const MujocoModel> model_;
  std::vector<double> tasks_;
};

}  // namespace pmeta
