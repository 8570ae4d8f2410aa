#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/env/mujoco_simulation.h"
#include "pmeta_core/mjcf/design.h"

namespace pmeta {

/// A robot of a model file whose observations, actions, rewards and ends are terms of its settings.
/// A step allocates nothing.
class MjcfEnv : public Env {
 public:
  /// The terms of `design` must have been found in `model`.
  MjcfEnv(std::shared_ptr<const MjcfDesign> design, std::shared_ptr<const MujocoModel> model);

  /// Restorable, with every number of observation and action described.
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;

  /// What the simulation depends on, controls, places of mocap bodies, time; goals, the last
  /// action, what reward terms remember; steps.
  std::vector<double> state() const override;
  void setState(const std::vector<double>& state) override;
  std::vector<double> configuration() const override;  ///< qpos, then places of mocap bodies

  const MujocoModel* model() const override { return &simulation_.model(); }
  /// The robot as the last step left it.
  const MujocoSimulation& simulation() const { return simulation_; }

 private:
  std::vector<Quantity> observed();
  std::vector<Quantity> acted();
  void act(const double* action);
  void refresh();
  Robot robot() const;
  void remember(const Robot& robot);
  Step judge(const Robot& robot) const;
  void observe(const Robot& robot, double* observation) const;

  std::shared_ptr<const MjcfDesign> design_;
  MujocoSimulation simulation_;
  std::vector<std::size_t> observed_sizes_;  ///< of each observation term
  std::vector<std::size_t> acted_sizes_;     ///< of each action term
  EnvSpec spec_;                             ///< made of the terms, whose sizes are then known
  std::vector<double> goals_;
  std::vector<double> action_;
  std::vector<double> memory_;
  bool needs_contact_forces_ = false;
  bool is_judged_apart_ = false;  ///< do some rewards count in evaluation or in training alone?
  int steps_ = 0;
};

}  // namespace pmeta
