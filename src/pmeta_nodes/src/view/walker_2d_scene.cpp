#include "pmeta_core/env/walker2d.h"
#include "view/robot_scene.h"

namespace pmeta_nodes {
namespace {

/// Walkers, all of which are to walk forward.
class Walker2dScene : public RobotScene {
 public:
  Walker2dScene(const pmeta::Walker2dParamsFamily& family, int num_tasks)
      : RobotScene(family, num_tasks, std::vector<RobotTarget>(num_tasks)) {}
};

const RegisteredScene<Walker2dScene, pmeta::Walker2dParamsFamily> kWalker("walker_2d_params");

}  // namespace
}  // namespace pmeta_nodes
