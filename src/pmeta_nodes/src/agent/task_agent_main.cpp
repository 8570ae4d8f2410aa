#include "agent/party_node.h"
#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/task_agent.h"

namespace {

constexpr char kHelp[] =
    R"(task_agent: trains the personalised policy of one task and sends auxiliary parameters.

  rosrun pmeta_nodes task_agent _task:=0 __ns:=/pmeta

private parameters
  ~task         index of the task, from 0 (required); test tasks come after the training tasks,
                and only evaluate the meta-policy
  ~resume       begin with the newest checkpoint of the run folder (default false)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
  ~results_dir  where this machine keeps what the node saves; by default that of the settings
  ~key_file     where this machine has the key; by default that of the settings
subscribes   meta_policy, round
publishes    auxiliary, returns, agent_status, task_<i>/trajectory, /diagnostics
Normally started by roslaunch pmeta_nodes gridworld.launch, one process for each task.
)";

int runAgent(const pmeta::Experiment& experiment) {
  const int task = pmeta_nodes::privateIndex("task", -1, experiment.totalTasks() - 1);
  if (task < 0) throw pmeta::Error("which task? Give the private parameter task, e.g. _task:=0.");
  const bool resume = pmeta_nodes::privateFlag("resume", false);
  if (experiment.hasMetaLearner()) {
    throw pmeta::Error("algorithm " + experiment.settings().algorithm +
                       " has no agents: all tasks are learnt by the node meta_learner.");
  }
  const auto make = [&] { return std::make_unique<pmeta::TaskAgent>(experiment, task); };
  return pmeta_nodes::PartyNode(experiment, make, experiment.family().taskName(task), resume)
      .spin();
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "task_agent", kHelp, runAgent);
}
