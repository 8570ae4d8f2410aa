#pragma once

#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "draw/robot_figure.h"
#include "pmeta_core/env/mujoco_view.h"
#include "pmeta_nodes/card.h"

namespace pmeta_nodes {

/// What a robot is to do.
struct RobotTarget {
  double direction = 0;            ///< angle in the plane, rad, 0 along x
  std::optional<double> velocity;  ///< m/s; none: as fast as possible
};

/// The robots of MuJoCo: a lane for each policy, in which the model's geoms play the episode by
/// forward kinematics of the recorded configurations, while floor and view follow the body that
/// MujocoView names, the torso.
///
/// "task_I/personal" and "task_I/meta" have their origins on the floor below the torso, x along
/// the lane, y up; "task_I/meta/robot" and its like below them is the model's world, moved along
/// with the torso, and turned so that z goes up the lane. One metre is scale() in both.
class RobotScene : public Scene {
 public:
  /// `targets` has one for each task, test tasks last, or none where robots are not to run
  /// anywhere. Throws Error where the environment has no model. `family` must outlive the scene.
  RobotScene(const pmeta::EnvFamily& family, int num_tasks, std::vector<RobotTarget> targets = {});

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  double stepSeconds() const override { return step_seconds_; }
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;
  visualization_msgs::MarkerArray moving(const SceneContent& content,
                                         const std::vector<double>& seconds) override;

  double scale() const { return cards_.scale; }  ///< units of the scene for 1 m

 private:
  /// Positions of the torso in an episode, worked out once.
  struct Path {
    pmeta_msgs::Trajectory::ConstPtr episode;
    std::vector<Position> torso;
  };
  /// One robot at one moment.
  struct Moment {
    int task = 0;
    int policy = 0;
    pmeta_msgs::Trajectory::ConstPtr episode;  ///< null: nothing to show
    std::size_t step = 0;
    const std::vector<Position>* torso = nullptr;
    std::string lane_frame;
    std::string robot_frame;
  };

  void readModels(int num_tasks);
  const std::vector<Position>& pathOf(int task, int policy,
                                      const pmeta_msgs::Trajectory::ConstPtr& episode);
  bool isPlanar() const { return view_.elevation == 0; }
  double unit() const { return size_ * scale(); }  ///< of the scene for 1 m of a usual robot
  double halfWidth() const;                        ///< m of floor on either side of the torso
  std::vector<LegendEntry> legend() const;
  RobotPicture pictureOf(const Moment& moment) const;
  void drawFloor(const Moment& moment, visualization_msgs::MarkerArray& scene) const;
  visualization_msgs::Marker drawPath(const Moment& moment) const;
  void drawTarget(int task, int policy, visualization_msgs::MarkerArray& scene) const;
  std::string speedText(const Moment& moment) const;

  const pmeta::EnvFamily& family_;
  std::vector<RobotTarget> targets_;
  pmeta::MujocoView view_;
  /// Of each task; those of one model share it.
  std::vector<std::shared_ptr<pmeta::MujocoKinematics>> kinematics_;
  double step_seconds_ = 0;
  double rest_height_ = 0;  // m, of the highest point at rest
  double size_ = 1;         // of the robot, in those of the usual ones
  double spacing_ = 1;      // m between lines on the floor: a power of ten
  Cards cards_;
  std::map<std::pair<int, int>, Path> paths_;
};

}  // namespace pmeta_nodes
