#include "launch/live_nodes.h"

#include <ros/network.h>

#include <cstdlib>

#include "launch/addresses.h"
#include "launch/launch_parent.h"
#include "launch/xml_rpc.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta_nodes {
namespace {

using XmlRpc::XmlRpcValue;

constexpr std::chrono::duration<double> kPatience{5};
constexpr char kDefaultMaster[] = "http://localhost:11311";

// of roslaunch's options: -p 11312, -p11312, --port 11312, --port=11312
std::string portOption(const std::vector<std::string>& words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool last = i + 1 == words.size();
    if ((words[i] == "-p" || words[i] == "--port") && !last) return words[i + 1];
    if (words[i].rfind("--port=", 0) == 0) return words[i].substr(7);
    if (words[i].rfind("-p", 0) == 0 && words[i].size() > 2) return words[i].substr(2);
  }
  return "";
}

}  // namespace

std::vector<LiveNode> liveNodes(const std::string& master, const std::vector<std::string>& names) {
  std::vector<XmlRpcCall> lookups;
  for (const std::string& name : names) lookups.push_back({master, "lookupNode", {name}});
  const auto uris = callAll(lookups, kPatience);
  std::vector<LiveNode> registered;
  std::vector<XmlRpcCall> pings;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!uris[i] || uris[i]->getType() != XmlRpcValue::TypeString) continue;
    std::string uri = *uris[i];
    pings.push_back({uri, "getPid", {}});
    registered.push_back({names[i], std::move(uri), 0});
  }
  const auto pids = callAll(pings, kPatience);
  std::vector<LiveNode> live;
  for (std::size_t i = 0; i < registered.size(); ++i) {
    if (!pids[i] || pids[i]->getType() != XmlRpcValue::TypeInt) continue;
    XmlRpcValue pid = *pids[i];
    registered[i].pid = pid;
    live.push_back(registered[i]);
  }
  return live;
}

std::string runOf(const std::string& master, const std::string& name) {
  auto value = callAll({{master, "getParam", {name}}}, kPatience).front();
  if (!value || value->getType() != XmlRpcValue::TypeString) return "";
  try {
    const std::string settings = *value;
    return pmeta::Experiment::parse(settings, name).settings().run_id;
  } catch (const std::exception&) {
    return "";  // of another version, or not ours at all
  }
}

std::string listNodes(const std::vector<LiveNode>& nodes) {
  std::vector<std::string> words;
  for (const LiveNode& node : nodes) {
    std::string host;
    std::uint32_t port = 0;
    ros::network::splitURI(node.uri, host, port);
    words.push_back(node.name + " (pid " + std::to_string(node.pid) +
                    (isHere(host) ? "" : " on " + host) + ")");
  }
  return pmeta::join(words);
}

std::string launchMaster() {
  const char* variable = std::getenv("ROS_MASTER_URI");
  const std::string uri = variable == nullptr || *variable == '\0' ? kDefaultMaster : variable;
  const std::string port = portOption(launchCommand());
  return port.empty() ? uri : "http://localhost:" + port;
}

}  // namespace pmeta_nodes
