#pragma once

#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <ros/ros.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "common/health.h"
#include "common/mailbox.h"
#include "common/refusals.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/console.h"
#include "pmeta_core/run/meta_keeper.h"
#include "pmeta_core/run/round_driver.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/checkpoint.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta_nodes {

/// A RoundDriver on ROS: one worker thread owns the rounds, callbacks only hand messages to it, and
/// what the driver asks for is published and written.
///
/// Subscribes to auxiliary, returns and agent_status; publishes meta_policy, round and scores (all
/// latched), and writes the run folder. Who has not been heard of for 1.5 s, or is late, is named
/// on `round`: since when, and what happens next. An agent that has failed for good ends the run,
/// unless a quorum of fewer than all is left. While the disk takes nothing, `round` says why.
///
/// The services `pause`, `evaluate` and `save_checkpoint` are the driver's requests. Only time
/// passes: the result is the same. The returns of an evaluation that was asked for are not written.
class MetaAggregatorNode : public pmeta::RoundOutlet {
 public:
  /// Creates the run folder; throws pmeta::Error if that cannot be.
  /// hold: stay after the last round, so that the scene and latched topics can be looked at.
  /// resume: go on with the run that the folder holds, if it holds one, from the newest checkpoint.
  MetaAggregatorNode(const pmeta::Experiment& experiment, bool hold, bool resume);
  ~MetaAggregatorNode() override;

  /// Spins until the run has ended (and, with hold, the node is stopped). Returns the exit code.
  int spin();

 private:
  using Clock = pmeta::RoundDriver::Clock;
  using Message = std::variant<pmeta_msgs::AuxiliaryUpdate::Ptr, pmeta_msgs::TaskReturn::ConstPtr,
                               pmeta_msgs::AgentStatus::ConstPtr>;

  std::unique_ptr<pmeta::RunLog> openLog(bool resume);
  void subscribe();
  void offerServices();
  void work();
  void runRounds();
  void endRounds();
  void awaitOnlookers();

  void take(const Message& message);
  void takeUpdate(pmeta_msgs::AuxiliaryUpdate& msg);
  void takeReturn(const pmeta_msgs::TaskReturn& msg);
  void takeFailure(const pmeta_msgs::AgentStatus& msg);
  void refuse(const std::string& reason);
  void refuseUpdate(int task, const std::string& reason);

  void publish(const pmeta::MetaPolicy& meta) override;
  void repeatMetaPolicy() override;
  void write(const pmeta::RoundBook::Round& round) override;
  void saveCheckpoint(int round) override;
  void showRound(const pmeta::RoundBook::Round& round) override;
  void tell(const pmeta::RunStanding& standing) override;
  void log(Level level, const std::string& sentence) override;

  void publishSummary();
  void reportHealth();
  HealthReport health();

  const pmeta::Experiment& experiment_;
  const bool hold_;
  const pmeta::Authenticator authenticator_;
  const std::uint64_t incarnation_ = ros::WallTime::now().toNSec();
  std::optional<pmeta::RoundDriver> driver_;  ///< never empty; the worker's, and down to refusals_
  pmeta::CheckpointFolder checkpoints_;
  pmeta::MetaKeeper keeper_;
  std::unique_ptr<pmeta::RunLog> log_;  ///< none: the run was finished before
  pmeta::RunConsole console_;
  pmeta_msgs::RoundSummary summary_;           ///< of the last complete round
  pmeta_msgs::MetaPolicy::ConstPtr meta_msg_;  ///< the newest, as it was sent
  Clock::time_point next_health_;  ///< when the worker reports, if nothing happens before
  Refusals refusals_;

  ros::NodeHandle nh_;
  ros::Publisher meta_pub_;
  ros::Publisher round_pub_;
  ros::Publisher scores_pub_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::ServiceServer> services_;
  Mailbox<Message> mailbox_;

  std::atomic<bool> stop_{false};
  std::atomic<bool> done_{false};
  std::atomic<bool> failed_{false};
  std::mutex health_mutex_;
  HealthReport health_report_;
  std::unique_ptr<Health> health_;
  std::thread worker_;
};

/// What `round` says before the first round is complete, but for the state.
pmeta_msgs::RoundSummary summaryBefore(const pmeta::Experiment& experiment);

/// Tells whoever follows the run that it cannot go on; takes a second, for them to hear it.
void announceStop(const pmeta::Experiment& experiment, const std::string& why);

}  // namespace pmeta_nodes
