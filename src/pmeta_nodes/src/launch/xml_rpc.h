#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace pmeta_nodes {

/// A call of the ROS master's or a node's XML-RPC interface; the caller's name comes first among
/// the arguments.
struct XmlRpcCall {
  std::string uri;                     ///< whom to call
  std::string method;                  ///< e.g. "getPid"
  std::vector<std::string> arguments;  ///< all of them text
};

/// Makes all calls at once and gives their values in the same order; none where nobody has answered
/// within `patience`, or not with success. Unlike roscpp's own calls these need no node and wait
/// for nobody longer.
std::vector<std::optional<XmlRpc::XmlRpcValue>> callAll(const std::vector<XmlRpcCall>& calls,
                                                        std::chrono::duration<double> patience);

}  // namespace pmeta_nodes
