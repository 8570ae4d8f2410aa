#include <cstdint>

#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "policy/policy_node.h"

namespace {

constexpr char kHelp[] =
    R"(policy_node: acts with a trained policy from a file.

  rosrun pmeta_nodes policy_node _policy:=RUN_FOLDER/policies/task_0.safetensors

private parameters
  ~policy      policy file of a run (required)
  ~task        which task to act on; for a meta-policy that is told its task by a one-hot input
  ~explore     false: a meta-policy that could find out its task acts as before it has (default
               true)
  ~seed        of the draws of its exploration (default 0)
subscribes   observation (std_msgs/Float64MultiArray), reward (std_msgs/Float64)
             an observation has as many numbers as the environment's; a reward is of each action,
             where a meta-policy finds out its task: the next action waits for it
offers       begin_episode (std_srvs/Trigger): an episode is over, and the next begins; there, too
publishes    action (std_msgs/Float64MultiArray): the greedy action, one number if it is discrete;
             /diagnostics
An observation of a wrong size, or that is not finite, gets a warning and no action.
)";

constexpr int kMostTasks = 1000000;  // whose policy it is decides how many there are
constexpr int kMostSeeds = 2147483647;

int act() {
  const std::string path = pmeta_nodes::privateText("policy", "");
  if (path.empty()) {
    throw pmeta::Error(
        "which policy? Give the private parameter policy, e.g. "
        "_policy:=RUN_FOLDER/policies/task_0.safetensors.");
  }
  const pmeta_nodes::PolicyNode node(
      path, pmeta_nodes::privateIndex("task", -1, kMostTasks),
      pmeta_nodes::privateFlag("explore", true),
      static_cast<std::uint64_t>(pmeta_nodes::privateIndex("seed", 0, kMostSeeds)));
  pmeta_nodes::spinUntilStopped();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runPlainNode(argc, argv, "policy_node", kHelp, act);
}
