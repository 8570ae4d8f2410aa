#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/mujoco_model.h"

struct mjData_;

namespace pmeta {

/// One running simulation of a model, which others may share.
///
/// What MuJoCo would report as a warning (a state that is not finite or beyond 1e10, too many
/// contacts) throws BrokenEpisode; after that, clear() or setState().
class MujocoSimulation {
 public:
  /// `environment` is for errors; a step makes `frame_skip` of the model's timesteps.
  MujocoSimulation(std::shared_ptr<const MujocoModel> model, std::string environment,
                   int frame_skip);

  const MujocoModel& model() const { return *model_; }  ///< what is simulated; never changed by it
  int nq() const { return nq_; }                        ///< numbers in a configuration
  /// Numbers in a velocity; fewer than nq() where there are quaternions.
  int nv() const { return nv_; }
  int nu() const { return nu_; }     ///< numbers in an action
  int numBodies() const;             ///< the world included
  double dt() const { return dt_; }  ///< seconds that a step takes

  double* qpos() { return qpos_; }                    ///< configuration, nq
  const double* qpos() const { return qpos_; }        ///< the same, to be read only
  double* qvel() { return qvel_; }                    ///< velocity, nv
  const double* qvel() const { return qvel_; }        ///< the same, to be read only
  const double* control() const { return control_; }  ///< of the last step, clipped, nu

  /// The origin of a body's frame (m), world axes; always at the same address. After a step it is
  /// that of the last evaluation within the step, not of the configuration the step ended in:
  /// MuJoCo does not evaluate once more, and neither does Gym.
  const double* bodyPosition(int body) const;
  double* bodyPosition(int body);  ///< the same, to be written to when a state is restored

  const mjData_* data() const { return data_.get(); }  ///< MuJoCo's own structure
  /// The same, to be written to: control, applied forces and the like.
  mjData_* data() { return data_.get(); }

  /// Back to the model's rest configuration, at rest.
  void clear();

  /// Evaluates all that follows from the configuration and velocity, as a start needs. MuJoCo
  /// normalises quaternions on the way. `step` is how many there have been, for errors.
  void forward(int step = 0);

  /// Steps with `action` (nu numbers, clipped to [-1, 1]); `step` is its number, for errors. Throws
  /// Error on an action that is not finite: that is no fault of the simulation.
  void step(const double* action, int step);

  /// The same with the controls and applied forces that data() holds.
  void advance(int step);

  /// What step() throws on an action that is not finite; `name` is that of its number `index`.
  [[noreturn]] void refuseAction(int step, std::size_t index, const std::string& name) const;

  /// Works out contactForces() from the last step; changes nothing that later steps depend on.
  void computeContactForces();

  /// External contact torque and force on each body (N m, N), 6 numbers each, the world first.
  const double* contactForces() const;

  /// Length of what appendState() appends.
  std::size_t stateSize() const;

  /// Configuration, velocity, activations of actuators (of those that have some), and the solver's
  /// warm start: all that a step depends on, but for its control.
  void appendState(std::vector<double>& state) const;

  /// Goes on from there; gives where the state's numbers end.
  const double* setState(const double* state);

 private:
  void check(int step) const;
  [[noreturn]] void broke(int step, const std::string& what) const;
  std::string at(int step) const;
  std::string jointOf(int index, const int* addresses) const;

  struct Delete {
    void operator()(mjData_* data) const;
  };
  std::shared_ptr<const MujocoModel> model_;
  std::unique_ptr<mjData_, Delete> data_;
  std::string environment_;
  int frame_skip_;
  int nq_;
  int nv_;
  int nu_;
  double dt_;
  double* qpos_;
  double* qvel_;
  double* control_;
};

}  // namespace pmeta
