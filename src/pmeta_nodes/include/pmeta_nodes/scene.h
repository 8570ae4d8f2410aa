#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include "pmeta_core/base/registry.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta_nodes {

/// What is known of one policy on one task. Null: nothing yet.
struct PolicyView {
  pmeta_msgs::Trajectory::ConstPtr episode;  ///< must be drawable, see Scene::problem()
  pmeta_msgs::TaskReturn::ConstPtr result;   ///< of the last complete round that had one
};

/// Both policies on one task.
struct TaskView {
  PolicyView personal;  ///< empty for a test task
  PolicyView meta;      ///< empty with independent training
};

/// All that a scene shows.
struct SceneContent {
  std::string experiment;        ///< its name, for the title
  int rounds = 0;                ///< C
  bool has_trajectories = true;  ///< false: agents send none, and the title says so
  bool has_personal = true;      ///< false: one learner of all tasks, and the scene says so
  bool has_meta = true;          ///< false: independent training, and the scene says so
  std::vector<TaskView> tasks;   ///< one for each task, test tasks last
  pmeta_msgs::RoundSummary::ConstPtr summary;  ///< null: no round yet
};

/// A scene, in its world frame `pmeta`, is a box of this size around the origin, seen from +z. It
/// is the same for any number of tasks, so that one rviz view fits all experiments.
constexpr double kSceneWidth = 12;
constexpr double kSceneHeight = 7.2;     ///< see kSceneWidth
constexpr char kWorldFrame[] = "pmeta";  ///< see kSceneWidth

/// What one family of environments looks like: all tasks side by side, each in frames of its own
/// below the world frame.
///
/// Namespaces name layers, ids follow from task and policy: every call gives the same set of them,
/// with DELETE for what is not there. Their number and length are bounded, whatever agents send.
class Scene {
 public:
  virtual ~Scene() = default;

  /// Frames of all tasks; they never change.
  virtual std::vector<geometry_msgs::TransformStamped> frames() const = 0;

  /// Why this message, of one of the scene's tasks, cannot be drawn, in a sentence; "" if it can.
  virtual std::string problem(const pmeta_msgs::Trajectory& trajectory) const = 0;

  /// What changes only with `content`.
  virtual visualization_msgs::MarkerArray still(const SceneContent& content) const = 0;

  /// How long a step of an episode takes when it is played, in s; 0: nothing is played.
  virtual double stepSeconds() const { return 0; }

  /// What is played: for each task, its episodes `seconds[task]` after their start.
  virtual visualization_msgs::MarkerArray moving(const SceneContent& /*content*/,
                                                 const std::vector<double>& /*seconds*/) {
    return {};
  }
};

/// Makes the scene of a family, which must outlive it; tasks from its numTasks() to `num_tasks` are
/// test tasks.
using SceneMaker =
    std::function<std::unique_ptr<Scene>(const pmeta::EnvFamily& family, int num_tasks)>;

/// Every scene, by the name of the environment family that it shows.
pmeta::Registry<SceneMaker>& scenes();

/// In the source of a scene, outside of any function:
///
///     const RegisteredScene<CartPoleScene, pmeta::CartPoleFamily> kCartPole("cart_pole");
template <class Drawn, class Family>
struct RegisteredScene : pmeta::Registered<SceneMaker> {
  /// `environment`: the family's name; throws std::logic_error if it has a scene.
  explicit RegisteredScene(const std::string& environment)
      : Registered(scenes(), environment, [](const pmeta::EnvFamily& family, int num_tasks) {
          return std::make_unique<Drawn>(dynamic_cast<const Family&>(family), num_tasks);
        }) {}
};

/// The scene of the experiment's environment. One that has no row is drawn from its model, or as
/// traces where it has none. The experiment must outlive it.
std::unique_ptr<Scene> makeScene(const pmeta::Experiment& experiment);

/// Steps of an episode: the number of its rewards.
std::size_t numSteps(const pmeta_msgs::Trajectory& trajectory);

/// The step that is seen so long after the start: the last one that has been made.
std::size_t stepAt(const pmeta_msgs::Trajectory& trajectory, double seconds, double step_seconds);

/// Steps 0 to `last`, evenly thinned out to about `most` where there are more; the last is kept.
std::vector<std::size_t> thinnedSteps(std::size_t last, std::size_t most);

/// Why the arrays of this message do not fit one another, in a sentence; "" if all is well: a known
/// policy, finite observations of that size, actions and rewards for each step.
std::string formProblem(const pmeta_msgs::Trajectory& trajectory, std::size_t observation_size);

}  // namespace pmeta_nodes
