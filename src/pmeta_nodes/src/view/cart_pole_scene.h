#pragma once

#include "pmeta_core/env/cart_pole.h"
#include "pmeta_nodes/card.h"

namespace pmeta_nodes {

/// The cart-poles: a lane for each policy, with the cart and pole that play the episode, to scale,
/// above the trace of the cart's positions, in which time runs down.
///
/// The lane's frame has its origin on the track where the cart's position is 0. A fallen pole turns
/// grey. Poles of more than kLongestPole are drawn with that length.
class CartPoleScene : public LaneScene {
 public:
  static constexpr double kTimeStep = 0.02;      ///< s, the environment's
  static constexpr double kPositionLimit = 2.4;  ///< m, beyond which an episode ends
  static constexpr double kCartHeight = 0.24;    ///< m; the pole turns about the middle of its top
  static constexpr double kLongestPole = 3;      ///< m

  CartPoleScene(const pmeta::CartPoleFamily& family, int num_tasks);  ///< as SceneMaker has it

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  double stepSeconds() const override { return kTimeStep; }
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;

 private:
  double poleLength(int task) const;
  void drawMoving(const PolicyView& view, int task, int policy, double seconds,
                  visualization_msgs::MarkerArray& scene) const override;

  const pmeta::CartPoleFamily& family_;
};

}  // namespace pmeta_nodes
