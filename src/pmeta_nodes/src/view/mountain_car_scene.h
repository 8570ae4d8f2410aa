#pragma once

#include "pmeta_core/env/mountain_car.h"
#include "pmeta_nodes/card.h"

namespace pmeta_nodes {

/// The mountain cars: on the left the hill of the task with the goal's flag and both policies'
/// cars, which play the episode; on the right both trajectories in the plane of position and
/// velocity.
///
/// Frames "task_I/hill" and "task_I/phase" have their origins at position 0 and height or
/// velocity 0.
class MountainCarScene : public LaneScene {
 public:
  /// s; the environment knows no seconds, this is what Gym draws it with.
  static constexpr double kTimeStep = 1 / 30.0;

  /// As SceneMaker has it.
  MountainCarScene(const pmeta::MountainCarFamily& family, int num_tasks);

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  double stepSeconds() const override { return kTimeStep; }
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;

  /// Height of the track, as Gym draws it: 0.45 sin(zeta x) + 0.55.
  static double height(double zeta, double position);

  double velocityScale() const;  ///< scale() for 1 of velocity, in the phase plot

 private:
  Point phasePoint(const pmeta_msgs::Trajectory& episode, std::size_t step) const;
  visualization_msgs::Marker drawPath(const PolicyView& view, int task, int policy) const;
  void drawMoving(const PolicyView& view, int task, int policy, double seconds,
                  visualization_msgs::MarkerArray& scene) const override;

  const pmeta::MountainCarFamily& family_;
};

}  // namespace pmeta_nodes
