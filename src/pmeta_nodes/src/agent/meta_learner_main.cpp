#include "agent/party_node.h"
#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/meta_trainer.h"

namespace {

constexpr char kHelp[] =
    R"(meta_learner: trains one meta-policy on all tasks in one process, in the place of the agents.

  rosrun pmeta_nodes meta_learner __ns:=/pmeta

private parameters
  ~resume       begin with the newest checkpoint of the run folder (default false)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
  ~results_dir  where this machine keeps what the node saves; by default that of the settings
  ~key_file     where this machine has the key; by default that of the settings
subscribes   meta_policy, round
publishes    auxiliary, returns, agent_status, task_<i>/trajectory for each task, /diagnostics
For algorithms that pool the trajectories of all tasks, such as maml_trpo and promp. Normally started
by roslaunch pmeta_nodes half_cheetah_dir.launch algorithm:=promp.
)";

int runMetaLearner(const pmeta::Experiment& experiment) {
  const std::string& algorithm = experiment.settings().algorithm;
  if (!experiment.hasMetaLearner()) {
    throw pmeta::Error("algorithm " + algorithm +
                       " has no meta-learner: each task is learnt by a node task_agent.");
  }
  const bool resume = pmeta_nodes::privateFlag("resume", false);
  const auto make = [&] { return std::make_unique<pmeta::MetaTrainer>(experiment); };
  return pmeta_nodes::PartyNode(experiment, make, algorithm, resume).spin();
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "meta_learner", kHelp, runMetaLearner);
}
