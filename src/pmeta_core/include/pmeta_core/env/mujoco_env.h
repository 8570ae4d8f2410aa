#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/env/mujoco_simulation.h"

namespace pmeta {

/// What the environments of MuJoCo share: actions from -1 to 1 (clipped), a torso, episodes that
/// the horizon truncates. A step allocates nothing.
class MujocoEnv : public Env {
 public:
  /// Restorable, with every number of observation and action described.
  const EnvSpec& spec() const final { return spec_; }
  void reset(Rng& rng, double* observation) final;
  Step step(const double* action, Rng& rng, double* observation) final;

  /// Configuration, velocity, the solver's warm start, position of the torso (as the last step left
  /// it, see MujocoSimulation::bodyPosition), steps.
  std::vector<double> state() const final;
  void setState(const std::vector<double>& state) final;
  std::vector<double> configuration() const final;  ///< qpos, as in the model

  const MujocoModel* model() const final { return &simulation_.model(); }

  /// The body as the last step left it.
  const MujocoSimulation& simulation() const { return simulation_; }

 protected:
  /// Actions are the motors of `layout`; what is observed is described by `observation`.
  MujocoEnv(const std::string& name, const MujocoLayout& layout, std::vector<Quantity> observation,
            int horizon, std::shared_ptr<const MujocoModel> model, int frame_skip);

  /// The layout's hinges from number `first` on, and how fast they turn.
  static std::vector<Quantity> jointAngles(const MujocoLayout& layout, std::size_t first);
  /// Angular velocities (rad/s) of the layout's hinges from number `first` on.
  static std::vector<Quantity> jointVelocities(const MujocoLayout& layout, std::size_t first);

  /// All parts, one after the other.
  static std::vector<Quantity> joined(const std::vector<std::vector<Quantity>>& parts);

  /// The sum of the squares of the last step's control.
  double squaredControl() const;

  MujocoSimulation simulation_;  ///< of this environment alone; the model may be shared
  const double* torso_;          ///< its position, as the last step left it

 private:
  /// Draws a start: configuration and velocity hold the model's rest when this is called.
  virtual void drawStart(Rng& rng, double* qpos, double* qvel) = 0;

  /// What the reward needs of the state before a step.
  virtual void beforeStep() = 0;

  /// Reward and termination of the step that has just been made.
  virtual Step afterStep() = 0;

  virtual void observe(double* observation) const = 0;

  EnvSpec spec_;
  int torso_body_;
  int steps_ = 0;
};

/// Settings of the families of such environments.
struct MujocoSettings {
  ModelChoice model;  ///< the shipped one unless `environment.model_file` names another
  int horizon = 200;  ///< steps of an episode

  void bind(Settings& settings);  ///< binds them below "environment."

  /// The chosen model, whose hash is then known. Throws Error if it is not of the hash that the
  /// settings give; see also MujocoModel::require().
  std::shared_ptr<const MujocoModel> open(const MujocoLayout& layout);
};

}  // namespace pmeta
