#pragma once

#include "pmeta_core/env/sparse_point.h"
#include "pmeta_nodes/card.h"

namespace pmeta_nodes {

/// The point robots: the half circle with all tasks' goals, the task's own bright and filled once a
/// policy has reached it (left half personal, right half meta), and both policies' paths, on which
/// the points play the episode. Beside them, maps of what both policies take the first action to be
/// worth.
///
/// Frames "task_I/plane" have their origins where episodes start.
class SparsePointScene : public LaneScene {
 public:
  static constexpr double kTimeStep = 0.2;  ///< s; the environment knows no seconds

  /// `family` must outlive the scene; tasks from its numTasks() to `num_tasks` are test tasks.
  SparsePointScene(const pmeta::SparsePointFamily& family, int num_tasks);

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  double stepSeconds() const override { return kTimeStep; }
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;

 private:
  /// The first step, up to `last`, after which the point is at the goal; -1 if there is none.
  int reachedAt(const pmeta_msgs::Trajectory& episode, int task, std::size_t last) const;
  Point pointAt(const pmeta_msgs::Trajectory& episode, std::size_t step) const;
  static std::string planeFrame(int task);
  void drawGoals(Figure& figure, int task) const;
  void drawMaps(const SceneContent& content, int task,
                visualization_msgs::MarkerArray& scene) const;
  visualization_msgs::Marker drawPath(const PolicyView& view, int task, int policy) const;
  void drawMoving(const PolicyView& view, int task, int policy, double seconds,
                  visualization_msgs::MarkerArray& scene) const override;

  const pmeta::SparsePointFamily& family_;
  const double bottom_;  // of the plane that is seen
};

}  // namespace pmeta_nodes
