#pragma once

#include <string>
#include <vector>

namespace pmeta_nodes {

/// The command line of the roslaunch that has started this process; empty if something else has.
std::vector<std::string> launchCommand();

}  // namespace pmeta_nodes
