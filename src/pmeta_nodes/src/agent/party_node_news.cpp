// What a party tells: updates and returns, until they have arrived; episodes; its state and health.
#include <algorithm>
#include <utility>

#include "agent/party_node.h"
#include "common/conversions.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;

constexpr auto kFirstResend = std::chrono::seconds(2);
constexpr auto kLongestResend = std::chrono::seconds(30);

}  // namespace

void PartyNode::deliver(const pmeta::TaskReturn& result) {
  pmeta_msgs::TaskReturn msg = toMsg(result, experiment_.family().taskName(result.task));
  msg.header.stamp = ros::Time::now();
  sign(authenticator_, msg);
  returns_pub_.publish(msg);
  const std::lock_guard<std::mutex> lock(mutex_);
  recent_returns_[{result.task, result.policy}].take(
      boost::make_shared<const pmeta_msgs::TaskReturn>(msg));
  unconfirmed_returns_.push_back(std::move(msg));
  resend_wait_ = kFirstResend;
  next_resend_ = Clock::now() + resend_wait_;
}

void PartyNode::deliver(pmeta::AuxiliaryUpdate update) {
  pmeta_msgs::AuxiliaryUpdate msg = toMsg(std::move(update));
  msg.header.stamp = ros::Time::now();
  sign(authenticator_, msg);
  auxiliary_pub_.publish(msg);
  const std::lock_guard<std::mutex> lock(mutex_);
  unconfirmed_updates_.push_back(std::move(msg));
  resend_wait_ = kFirstResend;
  next_resend_ = Clock::now() + resend_wait_;
}

// latching would keep only the last policy's episode for late viewers: they get both
void PartyNode::advertiseEpisodes(int task) {
  trajectory_pubs_[task] = nh_.advertise<pmeta_msgs::Trajectory>(
      "task_" + std::to_string(task) + "/trajectory", 4,
      [this, task](const ros::SingleSubscriberPublisher& viewer) {
        const std::lock_guard<std::mutex> lock(mutex_);
        for (const auto& [of, episode] : last_episodes_) {
          if (of.first == task) viewer.publish(episode);
        }
      });
}

void PartyNode::showEpisode(const std::function<std::optional<pmeta::Episode>()>& record, int task,
                            int round, pmeta::PolicyKind policy) {
  std::optional<pmeta::Episode> episode;
  try {
    episode = record();
  } catch (const pmeta::BrokenEpisode& broken) {
    ROS_WARN("there is no episode to show: %s", broken.what());
  }
  if (!episode) return;
  pmeta_msgs::Trajectory msg = toMsg(*episode, experiment_, task, round, policy);
  msg.header.stamp = ros::Time::now();
  trajectory_pubs_.at(task).publish(msg);
  const std::lock_guard<std::mutex> lock(mutex_);
  last_episodes_[{task, policy}] = std::move(msg);
}

void PartyNode::resend() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (unconfirmed_returns_.empty() && unconfirmed_updates_.empty()) return;
  if (Clock::now() < next_resend_) return;
  for (const auto& msg : unconfirmed_returns_) returns_pub_.publish(msg);
  for (const auto& msg : unconfirmed_updates_) auxiliary_pub_.publish(msg);
  // an aggregator that waits for others must not be flooded with large blobs
  resend_wait_ = std::min<std::chrono::seconds>(2 * resend_wait_, kLongestResend);
  next_resend_ = Clock::now() + resend_wait_;
}

void PartyNode::setState(std::uint8_t state, const std::string& message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.state = state;
    status_.message = message;
  }
  publishStatus();
}

void PartyNode::publishStatus() {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.header.stamp = ros::Time::now();
  status_.state_name = stateName(status_);
  status_.incarnation = incarnation_;
  for (const int task : tasks_) {
    status_.task = static_cast<std::uint32_t>(task);
    status_.task_name = experiment_.family().taskName(task);
    sign(authenticator_, status_);
    status_pub_.publish(status_);
  }
}

HealthReport PartyNode::health() {
  const std::lock_guard<std::mutex> lock(mutex_);
  HealthReport report;
  report.level = status_.state == AgentStatus::FAILED ? HealthReport::kError
                 : !checkpoint_trouble_.empty()       ? HealthReport::kWarn
                                                      : HealthReport::kOk;
  report.summary = checkpoint_trouble_.empty() ? status_.message : checkpoint_trouble_;
  report.values = {{"state", stateName(status_)},
                   {"round", std::to_string(status_.round)},
                   {"updates/s", pmeta::formatNumber(status_.updates_per_s)},
                   {"env steps/s", pmeta::formatNumber(status_.env_steps_per_s)},
                   {"loss", pmeta::formatNumber(status_.loss)},
                   {"distance to meta", pmeta::formatNumber(status_.distance_to_meta)},
                   {"broken episodes", std::to_string(status_.broken_episodes)},
                   {"unconfirmed messages",
                    std::to_string(unconfirmed_returns_.size() + unconfirmed_updates_.size())}};
  for (auto& figure : experiment_.family().figures()) report.values.push_back(std::move(figure));
  for (std::size_t k = 1; k < status_.losses.size(); ++k) {
    report.values.emplace_back("loss: " + status_.loss_names[k],
                               pmeta::formatNumber(status_.losses[k]));
  }
  for (auto& value : refusals_.values()) {
    // of strangers only: it is not taking part
    if (newest_round_ < 0) report.level = std::max(report.level, HealthReport::kWarn);
    report.values.push_back(std::move(value));
  }
  return report;
}

}  // namespace pmeta_nodes
