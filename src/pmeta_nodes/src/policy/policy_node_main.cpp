#include "common/run_node.h"
#include "policy/policy_node.h"
#include "policy/policy_params.h"

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

int act() {
  const pmeta_nodes::PolicyParams params = pmeta_nodes::policyParams();
  const pmeta_nodes::PolicyNode node(params.file, params.task, params.explores, params.seed);
  pmeta_nodes::spinUntilStopped();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runPlainNode(argc, argv, "policy_node", kHelp, act);
}
