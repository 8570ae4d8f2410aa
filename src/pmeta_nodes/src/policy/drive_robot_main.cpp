#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/process.h"
#include "policy/drive_robot.h"
#include "policy/policy_params.h"

namespace {

constexpr char kHelp[] =
    R"(drive_robot: drives a robot with a trained policy from a file.

  rosrun pmeta_nodes drive_robot _policy:=RUN_FOLDER/policies/task_0.safetensors

private parameters
  ~policy          policy file of a run (required)
  ~task            which task to act on; for a meta-policy that is told its task by a one-hot input
  ~explore         false: a meta-policy that could find out its task acts as before it has (default
                   true)
  ~seed            of the draws of its exploration (default 0)
  ~rate            commands a second (default: as the policy was trained)
  ~input_timeout   age in seconds at which an input is stale (default: two periods)
  ~slew            most that a number of the command changes in a second (default: any)
  ~actuators       the order of the command's numbers, by the policy file's names of its actions
                   (default: the file's)
  ~safe_action     what is commanded while the policy does not act, by name, e.g. {elbow: 0.1}
                   (default: 0 for each)
  ~single_inputs   observations that come one by one on input/NAME; all others are measured by joints
  ~ignored_joints  that joint_states may have, too
subscribes   joint_states (sensor_msgs/JointState), reward (std_msgs/Float64)
offers       arm (std_srvs/SetBool): true lets the policy act, false takes it back; it starts disarmed
             begin_episode (std_srvs/Trigger): an episode is over, and the next begins; where the
             policy observes rewards
publishes    command (std_msgs/Float64MultiArray): numbers in the policy file's bounds, named by the
             labels of its layout; /diagnostics
NAME is observed as the position of joint NAME, NAME_velocity and NAME_effort as what they say; a
reward is of each action, where a meta-policy finds out its task.
While it is disarmed, an input is stale, missing or refused, or the policy knows no action, the safe
action is commanded; /diagnostics says why.
)";

constexpr double kMostRate = 1e4;
constexpr double kMost = 1e9;

using namespace pmeta_nodes;

int drive() {
  const PolicyParams params = policyParams();
  const std::vector<std::string> single_inputs = privateNames("single_inputs");
  const std::vector<std::string> ignored_joints = privateNames("ignored_joints");
  pmeta::DriverSettings settings;
  settings.rate = privatePositive("rate", 0, kMostRate);
  settings.input_timeout = privatePositive("input_timeout", 0, kMost);
  settings.slew = privatePositive("slew", 0, kMost);
  settings.safe_action = privateNumbers("safe_action");
  settings.actuators = privateNames("actuators");
  settings.single_inputs = {single_inputs.begin(), single_inputs.end()};
  settings.ignored_joints = {ignored_joints.begin(), ignored_joints.end()};
  pmeta::RobotDriver driver(params.file, params.task, settings);
  if (params.explores) driver.explore(params.seed);
  const DriveRobot node(driver, single_inputs);
  pmeta::heedStopSignals();  // the safe action is the last that is commanded
  spinUntilStopped();
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return runPlainNode(argc, argv, "drive_robot", kHelp, drive); }
