#include "aggregator/onlookers.h"

#include <ros/ros.h>

#include <map>

#include "launch/xml_rpc.h"
#include "pmeta_core/base/settings.h"

namespace pmeta_nodes {
namespace {

using XmlRpc::XmlRpcValue;

constexpr std::chrono::duration<double> kPatience{2};

std::optional<XmlRpcValue> call(const std::string& uri, const std::string& method,
                                const std::vector<std::string>& arguments = {}) {
  return callAll({{uri, method, arguments}}, kPatience).front();
}

// A node's connections by topic: "i" those that bring it messages, "o" those that take them away.
std::map<std::string, int> connections(const std::string& node, const std::string& direction) {
  std::map<std::string, int> counts;
  auto uri = call(ros::master::getURI(), "lookupNode", {ros::names::resolve(node)});
  if (!uri || uri->getType() != XmlRpcValue::TypeString) return counts;
  auto links = call(*uri, "getBusInfo");
  if (!links || links->getType() != XmlRpcValue::TypeArray) return counts;
  // [id, to or from whom, direction, transport, topic, connected, ...]
  for (int i = 0; i < links->size(); ++i) {
    XmlRpcValue& link = (*links)[i];
    if (link.size() > 4 && link[2] == XmlRpcValue(direction)) {
      ++counts[static_cast<std::string>(link[4])];
    }
  }
  return counts;
}

// How many nodes publish each topic below this namespace.
std::map<std::string, int> publishers() {
  std::map<std::string, int> counts;
  auto state = call(ros::master::getURI(), "getSystemState");
  if (!state || state->getType() != XmlRpcValue::TypeArray || state->size() < 1) return counts;
  const std::string below = ros::names::clean(ros::this_node::getNamespace() + "/");
  XmlRpcValue& topics = (*state)[0];
  for (int i = 0; i < topics.size(); ++i) {
    const std::string topic = topics[i][0];
    if (topic.rfind(below + "/", 0) == 0) counts[topic] = topics[i][1].size();
  }
  return counts;
}

}  // namespace

Onlookers::Onlookers(bool viewer, bool recorder, int agents)
    : viewer_(viewer), recorder_(recorder), agents_(agents) {}

std::string Onlookers::missing() const {
  std::vector<std::string> words;
  if (viewer_ && !viewerSees()) words.emplace_back("rviz");
  if (recorder_ && !recorderHears()) words.emplace_back("the recorder");
  return pmeta::join(words, " and ");
}

bool Onlookers::viewerSees() const {
  return connections("trajectory_view", "o")[ros::names::resolve("markers")] > 0;
}

bool Onlookers::recorderHears() const {
  std::map<std::string, int> published = publishers();
  // what is played is not recorded
  published.erase(ros::names::resolve("playback"));
  if (published[ros::names::resolve("agent_status")] < agents_) return false;
  std::map<std::string, int> heard = connections("recorder", "i");
  for (const auto& [topic, count] : published) {
    if (heard[topic] < count) return false;
  }
  return true;
}

}  // namespace pmeta_nodes
