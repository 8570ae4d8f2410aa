#pragma once

#include <string>
#include <vector>

namespace pmeta_nodes {

/// A node that is registered with a ROS master and answers.
struct LiveNode {
  std::string name;  ///< its full name
  std::string uri;   ///< of its XML-RPC interface
  int pid = 0;       ///< of its process, on the host that `uri` names
};

/// Which of the nodes of these names live. The registrations that killed nodes leave behind do not
/// count, and neither does a master that does not answer know any.
std::vector<LiveNode> liveNodes(const std::string& master, const std::vector<std::string>& names);

/// The run_id in the settings that the parameter `name` holds; "" if it holds none.
std::string runOf(const std::string& master, const std::string& name);

/// "/pmeta/run_guard (pid 12), /pmeta/task_agent_0 (pid 13 on robot)"
std::string listNodes(const std::vector<LiveNode>& nodes);

/// Where the master is that a launch file's commands work for: roslaunch's option -p goes before
/// the variable ROS_MASTER_URI, which it does not set for them.
std::string launchMaster();

}  // namespace pmeta_nodes
