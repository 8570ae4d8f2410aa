#include "policy/policy_node.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "pmeta_core/base/error.h"

namespace pmeta_nodes {

PolicyNode::PolicyNode(const std::string& path, int task) : policy_(path, task) {
  if (policy_.task() >= 0 && task >= 0 && task != policy_.task()) {
    throw pmeta::Error("the private parameter task is " + std::to_string(task) + " but " + path +
                       " is the personal policy of task " + std::to_string(policy_.task()) +
                       ": leave the parameter out.");
  }
  const std::string description = policy_.description();
  action_.data.resize(static_cast<std::size_t>(policy_.spec().action_size));
  action_pub_ = nh_.advertise<std_msgs::Float64MultiArray>("action", 1);
  observation_sub_ = nh_.subscribe("observation", 1, &PolicyNode::onObservation, this,
                                   ros::TransportHints().tcpNoDelay());
  health_ = std::make_unique<Health>(description, "policy", [this] { return health(); });
  ROS_INFO("acting with the %s: %d numbers an observation, on %s", description.c_str(),
           policy_.spec().observation_size, observation_sub_.getTopic().c_str());
}

void PolicyNode::onObservation(const std_msgs::Float64MultiArray::ConstPtr& msg) {
  const auto start = std::chrono::steady_clock::now();
  const auto size = static_cast<std::size_t>(policy_.spec().observation_size);
  if (msg->data.size() != size) {
    ++refused_;
    ROS_WARN_THROTTLE(5, "refused an observation of %zu numbers: this policy's have %zu.",
                      msg->data.size(), size);
    return;
  }
  if (!policy_.act(msg->data.data(), action_.data.data())) {
    ++refused_;
    ROS_WARN_THROTTLE(5,
                      "refused an observation that is not finite, or that the policy has no "
                      "values of.");
    return;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  action_pub_.publish(action_);
  ++answered_;
  seconds_ += seconds.count();
  longest_seconds_ = std::max(longest_seconds_, seconds.count());
}

HealthReport PolicyNode::health() const {
  const auto microseconds = [](double seconds) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", 1e6 * seconds);
    return std::string(text);
  };
  HealthReport report;
  report.summary = answered_ == 0 ? "waiting for observations" : "acting";
  report.values = {{"actions", std::to_string(answered_)},
                   {"refused observations", std::to_string(refused_)},
                   {"mean latency [us]",
                    answered_ == 0 ? "-" : microseconds(seconds_ / static_cast<double>(answered_))},
                   {"max latency [us]", answered_ == 0 ? "-" : microseconds(longest_seconds_)}};
  return report;
}

}  // namespace pmeta_nodes
