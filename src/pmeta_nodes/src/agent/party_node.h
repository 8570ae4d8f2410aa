#pragma once

#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>
#include <ros/ros.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/health.h"
#include "common/mailbox.h"
#include "common/news_order.h"
#include "common/recent_returns.h"
#include "common/refusals.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/party.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta_nodes {

/// A Party on ROS, an agent or the meta-learner: a training thread fed with the newest meta-policy,
/// and the topics around it.
///
/// Subscribes to meta_policy and round; publishes auxiliary, returns, agent_status and
/// task_I/trajectory, the latter two for each of its tasks. What the aggregator must get is sent
/// again until a newer meta-policy, or the end of the run, shows that it has it. With a key_file,
/// what it sends is signed and what is not authentic it ignores. A checkpoint is on the disk before
/// that round's update is sent, so an agent that is killed comes back with all that anybody has
/// seen of it; where the aggregator had to go back some rounds, the agent follows. Training that
/// cannot go on (TaskFailed) is told by the state FAILED until the run has ended: the same would
/// come of it if it were started again. The last round's personal policy stays on this machine, as
/// policies/task_I.safetensors of the run folder.
class PartyNode {
 public:
  /// Gives the party as it is before round 1.
  using MakeParty = std::function<std::unique_ptr<pmeta::Party>()>;

  /// name: of its health. resume: begin with the
  /// newest checkpoint in the run folder, if there is one.
  PartyNode(const pmeta::Experiment& experiment, MakeParty make, const std::string& name,
            bool resume);
  ~PartyNode();

  /// Spins until stopped, or until some seconds after the run has ended. Returns the exit code.
  int spin();

 private:
  using Clock = std::chrono::steady_clock;

  void onMetaPolicy(const pmeta_msgs::MetaPolicy::Ptr& msg);
  void onRound(const pmeta_msgs::RoundSummary::ConstPtr& msg);
  bool isAuthentic(const std::string& kind, pmeta::Authenticity authenticity);

  void train();
  void giveUp(const std::string& failure);
  void evaluate(const pmeta::MetaPolicy& meta);
  void trainFrom(const pmeta::MetaPolicy& meta);
  void returnTo(const pmeta::MetaPolicy& meta);
  void saveCheckpoint(int round);
  void savePersonal(int round);
  void waitForAggregator();
  void deliver(const pmeta::TaskReturn& result);
  void deliver(pmeta::AuxiliaryUpdate update);
  void advertiseEpisodes(int task);
  void showEpisode(const std::function<std::optional<pmeta::Episode>()>& record, int task,
                   int round, pmeta::PolicyKind policy);
  void setState(std::uint8_t state, const std::string& message);
  void publishStatus();
  void resend();
  HealthReport health();

  const pmeta::Experiment& experiment_;
  const std::string settings_hash_;
  const bool resume_;
  const MakeParty make_;
  const std::string name_;
  std::unique_ptr<pmeta::Party> party_;  ///< the trainer's, as are the three below
  pmeta::CheckpointFolder checkpoints_;
  int saved_round_ = 0;
  std::optional<Clock::time_point> round_end_;  ///< of the last round that was trained
  const std::vector<int> tasks_;                ///< the party's
  const pmeta::Authenticator authenticator_;
  ros::NodeHandle nh_;
  ros::Publisher auxiliary_pub_;
  ros::Publisher returns_pub_;
  ros::Publisher status_pub_;
  std::map<int, ros::Publisher> trajectory_pubs_;  ///< by task; none if they are not published
  ros::Subscriber meta_sub_;
  ros::Subscriber round_sub_;
  ros::WallTimer status_timer_;
  ros::WallTimer resend_timer_;

  Mailbox<pmeta_msgs::MetaPolicy::Ptr> mailbox_{1};
  std::atomic<bool> stop_{false};
  std::atomic<bool> failed_{false};
  std::atomic<bool> gave_up_{false};  ///< the state is FAILED, and stays so
  std::atomic<bool> run_ended_{false};

  Refusals refusals_;  ///< the spinning thread's, as is news_
  NewsOrder news_;     ///< of messages about the run's state

  std::mutex mutex_;                ///< guards what follows
  pmeta_msgs::AgentStatus status_;  ///< but for the task
  std::vector<pmeta_msgs::TaskReturn> unconfirmed_returns_;
  std::vector<pmeta_msgs::AuxiliaryUpdate> unconfirmed_updates_;
  using OfTask = std::pair<int, pmeta::PolicyKind>;
  std::map<OfTask, pmeta_msgs::Trajectory> last_episodes_;
  std::map<OfTask, RecentReturns> recent_returns_;
  Clock::time_point next_resend_;
  std::chrono::seconds resend_wait_{2};
  int newest_round_ = -1;
  std::uint64_t incarnation_ = 0;   ///< of the aggregator that it is from
  std::string checkpoint_trouble_;  ///< why the last one could not be written; "" if it was

  std::unique_ptr<Health> health_;
  std::thread trainer_;
};

}  // namespace pmeta_nodes
