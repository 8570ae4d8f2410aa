#include "policy/policy_node.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "pmeta_core/base/error.h"

namespace pmeta_nodes {

PolicyNode::PolicyNode(const std::string& path, int task, bool explores, std::uint64_t seed)
    : policy_(path, task) {
  if (policy_.task() >= 0 && task >= 0 && task != policy_.task()) {
    throw pmeta::Error("the private parameter task is " + std::to_string(task) + " but " + path +
                       " is the personal policy of task " + std::to_string(policy_.task()) +
                       ": leave the parameter out.");
  }
  const std::string& other_package = policy_.experiment().otherPackage();
  if (!other_package.empty()) ROS_WARN("%s", other_package.c_str());
  const std::string description = policy_.description();
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  action_.data.resize(static_cast<std::size_t>(policy_.spec().action_size));
  action_pub_ = nh_.advertise<std_msgs::Float64MultiArray>("action", 1);
  observation_sub_ = nh_.subscribe("observation", 1, &PolicyNode::onObservation, this, hints);
  if (explores && policy_.explore(seed)) {
    reward_sub_ = nh_.subscribe("reward", 1, &PolicyNode::onReward, this, hints);
    begin_episode_ = nh_.advertiseService("begin_episode", &PolicyNode::onBeginEpisode, this);
  }
  health_ = std::make_unique<Health>(description, "policy", [this] { return health(); });
  ROS_INFO("acting with the %s: %d numbers an observation, on %s", description.c_str(),
           policy_.spec().observation_size, observation_sub_.getTopic().c_str());
  if (reward_sub_) {
    ROS_INFO(
        "it finds out its task in %d episodes first, by the rewards on %s; call %s at the "
        "end of each",
        policy_.explorationEpisodes(), reward_sub_.getTopic().c_str(),
        begin_episode_.getService().c_str());
  }
}

void PolicyNode::onObservation(const std_msgs::Float64MultiArray::ConstPtr& msg) {
  const auto size = static_cast<std::size_t>(policy_.spec().observation_size);
  if (msg->data.size() != size) {
    refuse("an observation of " + std::to_string(msg->data.size()) +
           " numbers: this policy's have " + std::to_string(size) + ".");
    return;
  }
  if (!awaits_) {
    answer(msg->data);
    return;
  }
  next_observation_ = msg->data;
  goOn();
}

void PolicyNode::onReward(const std_msgs::Float64::ConstPtr& msg) {
  if (!awaits_) {
    refuse("a reward of no action: send one reward for each action.");
    return;
  }
  reward_ = msg->data;
  goOn();
}

bool PolicyNode::onBeginEpisode(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  awaits_ = false;
  forgetOutcome();
  policy_.beginEpisode();
  response.success = 1;
  response.message = doing();
  ROS_INFO("%s", response.message.c_str());
  return true;
}

// once both parts of what came of the last action are there
void PolicyNode::goOn() {
  if (!reward_ || !next_observation_) return;
  const double reward = *reward_;
  const std::vector<double> observation = *next_observation_;
  forgetOutcome();
  if (policy_.observe(reward, observation.data())) {
    answer(observation);
  } else {
    refuse("an observation and its reward, which are not finite.");
  }
}

void PolicyNode::forgetOutcome() {
  reward_.reset();
  next_observation_.reset();
}

void PolicyNode::answer(const std::vector<double>& observation) {
  const auto start = std::chrono::steady_clock::now();
  if (!policy_.act(observation.data(), action_.data.data())) {
    refuse("an observation that is not finite, or that the policy has no values of.");
    return;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  awaits_ = policy_.observes();
  action_pub_.publish(action_);
  ++answered_;
  seconds_ += seconds.count();
  longest_seconds_ = std::max(longest_seconds_, seconds.count());
}

void PolicyNode::refuse(const std::string& what) {
  ++refused_;
  ROS_WARN_THROTTLE(5, "refused %s", what.c_str());
}

std::string PolicyNode::doing() const {
  if (policy_.exploring()) {
    return "exploring, episode " + std::to_string(std::max(policy_.episode(), 1)) + " of " +
           std::to_string(policy_.explorationEpisodes());
  }
  return answered_ == 0 ? "waiting for observations" : "acting";
}

HealthReport PolicyNode::health() const {
  const auto microseconds = [](double seconds) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", 1e6 * seconds);
    return std::string(text);
  };
  HealthReport report;
  report.summary = doing();
  report.values = {{"actions", std::to_string(answered_)},
                   {"refused observations", std::to_string(refused_)},
                   {"mean latency [us]",
                    answered_ == 0 ? "-" : microseconds(seconds_ / static_cast<double>(answered_))},
                   {"max latency [us]", answered_ == 0 ? "-" : microseconds(longest_seconds_)}};
  const std::vector<double> weights = policy_.taskWeights();
  for (std::size_t task = 0; task < weights.size(); ++task) {
    char percent[16];
    std::snprintf(percent, sizeof percent, "%.1f %%", 100 * weights[task]);
    report.values.push_back(
        {"it is " + policy_.experiment().family().taskName(static_cast<int>(task)), percent});
  }
  return report;
}

}  // namespace pmeta_nodes
