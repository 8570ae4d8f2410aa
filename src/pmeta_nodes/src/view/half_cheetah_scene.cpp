#include <cmath>

#include "pmeta_core/env/half_cheetah.h"
#include "view/robot_scene.h"

namespace pmeta_nodes {
namespace {

/// Half-cheetahs that are to run forward, backward or at a velocity.
class HalfCheetahScene : public RobotScene {
 public:
  HalfCheetahScene(const pmeta::HalfCheetahFamily& family, int num_tasks)
      : RobotScene(family, num_tasks, targetsOf(family, num_tasks)) {}

 private:
  static std::vector<RobotTarget> targetsOf(const pmeta::HalfCheetahFamily& family, int num_tasks) {
    std::vector<RobotTarget> targets(num_tasks);
    for (int task = 0; task < num_tasks; ++task) {
      const pmeta::HalfCheetahTask& goal = family.task(task);
      targets[task].direction = goal.value < 0 ? kPi : 0;
      if (goal.goal == pmeta::HalfCheetahTask::Goal::kVelocity) {
        targets[task].velocity = std::abs(goal.value);
      }
    }
    return targets;
  }
};

const RegisteredScene<HalfCheetahScene, pmeta::HalfCheetahFamily> kDir("half_cheetah_dir");
const RegisteredScene<HalfCheetahScene, pmeta::HalfCheetahFamily> kVel("half_cheetah_vel");

}  // namespace
}  // namespace pmeta_nodes
