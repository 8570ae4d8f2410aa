#pragma once

#include <memory>
#include <string>
#include <vector>

#include "../env/continuous_env.h"
#include "../support.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta::test {

/// A pendulum of two links on a free base above a floor, with actuators of two kinds, sensors, a
/// keyframe and a target.
inline constexpr char kSmallModel[] = R"(<mujoco model="small">
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <body name="base" pos="0 0 1">
      <joint name="root" type="free"/>
      <geom name="base" type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="upper" pos="0 0 -0.1">
        <joint name="shoulder" axis="0 1 0" damping="0.1"/>
        <geom name="upper" type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/>
        <site name="elbow" pos="0 0 -0.3"/>
        <body name="lower" pos="0 0 -0.3">
          <joint name="elbow" axis="0 1 0" damping="0.1"/>
          <geom name="lower" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.2"/>
          <site name="tip" pos="0 0 -0.2"/>
        </body>
      </body>
    </body>
    <body name="target" mocap="true"><geom type="sphere" size="0.02" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder" ctrllimited="true" ctrlrange="-2 4"/>
    <general name="elbow" joint="elbow" dyntype="filter" dynprm="0.05" gainprm="3"/>
  </actuator>
  <sensor>
    <gyro name="turning" site="tip"/>
    <actuatorfrc name="push" actuator="elbow"/>
  </sensor>
  <keyframe><key name="bent" qpos="0 0 1 1 0 0 0 0.3 -0.4" ctrl="1 0.5"/></keyframe>
</mujoco>)";

/// The settings file of such a robot, but for what follows `frame_skip`.
inline constexpr char kSmallHead[] = R"(experiment: small
learner: sac
environment:
  name: mjcf
  model_file: small.xml
  frame_skip: 5
)";

/// Everything that a robot may have, in all sections.
inline constexpr char kSmallTerms[] = R"(  goals:
    reach: {term: ring, centre: [0, 0, 0.6], plane: xz, radius: [0.1, 0.3], body: target}
  observations:
    joint_positions: {}
    joint_velocities: {joints: [shoulder, root.vz], clip: 3}
    tip: {term: site_position, site: tip, axes: [x, z]}
    turning: {term: sensor, sensor: turning}
    reach: {term: goal_position, goal: reach}
    offset: {term: goal_offset, goal: reach, site: tip}
    contact_forces: {bodies: [lower]}
    controls: {}
    last_action: {}
  actions:
    shoulder: {term: control, actuators: [shoulder]}
    elbow: {term: control_change, actuators: [elbow], limit: 0.5, rate: 10}
    lift: {term: joint_forces, joints: [root.vz], limit: 30}
  rewards:
    near: {term: goal_velocity, goal: reach, site: tip, weight: 2}
    control_cost: {weight: -0.1}
    there: {term: goal_reached, goal: reach, site: tip, within: 0.1, counts: evaluation}
  terminations:
    fallen: {term: height_outside, body: base, low: 0.3, high: 3}
  starts:
    bent: {term: keyframe, keyframe: bent}
    joint_noise: {joints: [shoulder, elbow], position: 0.1}
    hold: {actuators: [shoulder]}
)";

/// An experiment of the small robot, whose model lies in `dir`.
inline Experiment smallRobot(const TempDir& dir, const std::string& terms = kSmallTerms,
                             const std::vector<std::string>& overrides = {}) {
  writeFile(dir / "small.xml", kSmallModel);
  return Experiment::parse(kSmallHead + terms, "small.yaml", overrides, dir.path());
}

}  // namespace pmeta::test
