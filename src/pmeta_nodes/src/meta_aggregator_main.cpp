#include "meta_aggregator_node.h"
#include "node_main.h"

namespace {

constexpr char kHelp[] =
    R"(meta_aggregator: mixes the agents' parameters into the meta-policy, round by round, and writes the
run folder.

  rosrun pmeta_nodes meta_aggregator __ns:=/pmeta

private parameters
  ~hold         stay after the last round until stopped (default false)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
subscribes   auxiliary, returns
publishes    meta_policy, round (both latched), /diagnostics
offers       pause (std_srvs/SetBool): true holds the next meta-policy back, false lets the run go on
Normally started by roslaunch pmeta_nodes gridworld.launch.
)";

int runAggregator(const pmeta::Experiment& experiment) {
  const bool hold = ros::NodeHandle("~").param("hold", false);
  return pmeta_nodes::MetaAggregatorNode(experiment, hold).spin();
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "meta_aggregator", kHelp, runAggregator);
}
