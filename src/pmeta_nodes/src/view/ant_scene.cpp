#include "pmeta_core/env/ant.h"
#include "view/robot_scene.h"

namespace pmeta_nodes {
namespace {

/// Ants that are to run in a direction.
class AntScene : public RobotScene {
 public:
  AntScene(const pmeta::AntFwdBackFamily& family, int num_tasks)
      : RobotScene(family, num_tasks, targetsOf(family, num_tasks)) {}

 private:
  static std::vector<RobotTarget> targetsOf(const pmeta::AntFwdBackFamily& family, int num_tasks) {
    std::vector<RobotTarget> targets(num_tasks);
    for (int task = 0; task < num_tasks; ++task) targets[task].direction = family.angle(task);
    return targets;
  }
};

const RegisteredScene<AntScene, pmeta::AntFwdBackFamily> kAnt("ant_fwd_back");

}  // namespace
}  // namespace pmeta_nodes
