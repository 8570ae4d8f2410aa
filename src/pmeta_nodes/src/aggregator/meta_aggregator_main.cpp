#include "aggregator/meta_aggregator_node.h"
#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"

namespace {

constexpr char kHelp[] =
    R"(meta_aggregator: mixes the agents' parameters into the meta-policy, round by round, and writes the
run folder.

  rosrun pmeta_nodes meta_aggregator __ns:=/pmeta

private parameters
  ~hold         stay after the last round until stopped (default false)
  ~resume       go on with the run that the run folder holds, if it holds one (default false)
  ~await_viewer    round 1 waits for rviz on trajectory_view, 30 s at most (default false)
  ~await_recorder  round 1 waits for rosbag's node `recorder` to hear all, 30 s at most (default false)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
subscribes   auxiliary, returns, agent_status
publishes    meta_policy, round, scores (all latched), /diagnostics
offers       pause (std_srvs/SetBool): true holds the next meta-policy back, false lets the run go on
             evaluate (std_srvs/Trigger): the next meta-policy is evaluated, whatever the schedule
             save_checkpoint (std_srvs/Trigger): all save one when the next round is done
Normally started by roslaunch pmeta_nodes gridworld.launch.
)";

int runAggregator(const pmeta::Experiment& experiment) {
  const bool hold = pmeta_nodes::privateFlag("hold", false);
  const bool resume = pmeta_nodes::privateFlag("resume", false);
  try {
    return pmeta_nodes::MetaAggregatorNode(experiment, hold, resume).spin();
  } catch (const pmeta::Error& error) {
    pmeta_nodes::announceStop(experiment, error.what());
    throw;
  }
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "meta_aggregator", kHelp, runAggregator);
}
