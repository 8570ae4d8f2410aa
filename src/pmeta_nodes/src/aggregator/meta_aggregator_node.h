#pragma once

#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "aggregator/roll_call.h"
#include "common/health.h"
#include "common/mailbox.h"
#include "common/refusals.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/console.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/checkpoint.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta_nodes {

/// A MetaAggregator on ROS: one worker thread owns the rounds, callbacks only hand messages to it.
///
/// Subscribes to auxiliary and returns; publishes meta_policy, round and scores (all latched), and
/// writes the run folder. A round is closed once every task's update and return are in, or, after
/// round_timeout, once a quorum of updates is. Who has not been heard of for 1.5 s, or is late, is
/// named on `round`: since when, and what happens next. An agent that has failed for good ends the
/// run, unless a quorum of fewer than all is left.
///
/// After each checkpoint.interval-th round the state is saved before the meta-policy goes out, so
/// that whoever has seen a round can count on it. While the disk takes nothing, the round in hand
/// is held, `round` says why, and writing is tried again.
///
/// The service `pause` (true) holds the next meta-policy back, so that agents wait once the round
/// in hand is done; `pause` (false) lets the run go on. Only time passes: the result is the same.
/// The service `evaluate` has agents evaluate the next meta-policy, and the personal policies that
/// they train from it, also outside the schedule; those returns are not written.
class MetaAggregatorNode {
 public:
  /// Creates the run folder; throws pmeta::Error if that cannot be.
  /// hold: stay after the last round, so that the scene and latched topics can be looked at.
  /// resume: go on with the run that the folder holds, if it holds one, from the newest checkpoint.
  MetaAggregatorNode(const pmeta::Experiment& experiment, bool hold, bool resume);
  ~MetaAggregatorNode();

  /// Spins until the run has ended (and, with hold, the node is stopped). Returns the exit code.
  int spin();

 private:
  using Clock = std::chrono::steady_clock;
  using Message = std::variant<pmeta_msgs::AuxiliaryUpdate::Ptr, pmeta_msgs::TaskReturn::ConstPtr,
                               pmeta_msgs::AgentStatus::ConstPtr>;

  /// What a checkpoint holds.
  struct State {
    pmeta::MetaAggregator& aggregator;
    pmeta::RoundBook& book;

    void saveState(pmeta::StateWriter& writer) const;
    void loadState(pmeta::StateReader& reader);
  };

  static const char kPaused[];

  std::unique_ptr<pmeta::RunLog> openLog(bool resume);
  bool onSaveCheckpoint(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onPause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool onEvaluate(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void work();
  void runRounds();
  void awaitOnlookers();
  void take(const Message& message);
  void takeUpdate(pmeta_msgs::AuxiliaryUpdate& msg);
  void takeReturn(const pmeta_msgs::TaskReturn& msg);
  void takeFailure(const pmeta_msgs::AgentStatus& msg);
  void refuse(const std::string& reason);
  void refuseUpdate(int task, const std::string& reason);
  void closeRoundIfDue();
  void collectCompleteRounds(bool force);
  void writeDown();
  void saveCheckpoint();
  void publishMetaPolicy();
  void repeatLastWords();
  void announcePause();
  void publishRound(std::uint8_t state, const std::string& message);
  void announceMissing();
  int roundInHand() const;
  std::string silenceText() const;
  std::string waitText() const;
  void reportHealth();
  std::string taskNames(const std::vector<int>& tasks) const;
  double roundSeconds() const;
  HealthReport health();

  const pmeta::Experiment& experiment_;
  const bool hold_;
  const pmeta::Authenticator authenticator_;
  const std::uint64_t incarnation_ = ros::WallTime::now().toNSec();
  pmeta::MetaAggregator aggregator_;  ///< the worker's, as are book_ and log_
  pmeta::RoundBook book_;
  pmeta::CheckpointFolder checkpoints_;
  std::unique_ptr<pmeta::RunLog> log_;             ///< none: the run was finished before
  std::deque<pmeta::RoundBook::Round> unwritten_;  ///< complete rounds on their way to the disk
  bool unpublished_ = false;        ///< a closed round's meta-policy waits for the disk
  std::string disk_trouble_;        ///< why writing failed; "" while it works
  Clock::time_point next_attempt_;  ///< to write
  int checkpoint_round_ = 0;        ///< for which a checkpoint was asked
  pmeta::RunConsole console_;
  Clock::time_point round_start_;
  Clock::time_point next_announcement_;
  std::optional<Clock::time_point> held_since_;  ///< the round is due, but the run is paused
  bool pause_announced_ = false;
  pmeta_msgs::RoundSummary summary_;  ///< of the last complete round
  RollCall roll_call_;
  std::vector<int> silent_;  ///< as announced
  Refusals refusals_;

  ros::NodeHandle nh_;
  ros::Publisher meta_pub_;
  pmeta_msgs::MetaPolicy::ConstPtr meta_msg_;  ///< the newest, as it was sent
  ros::Publisher round_pub_;
  ros::Publisher scores_pub_;
  ros::Subscriber auxiliary_sub_;
  ros::Subscriber returns_sub_;
  ros::Subscriber status_sub_;
  ros::ServiceServer pause_service_;
  ros::ServiceServer evaluate_service_;
  ros::ServiceServer checkpoint_service_;
  Mailbox<Message> mailbox_;

  std::atomic<bool> stop_{false};
  std::atomic<bool> paused_{false};
  std::atomic<bool> evaluate_{false};     ///< the next meta-policy
  std::atomic<bool> last_is_out_{false};  ///< of the meta-policies
  std::atomic<bool> checkpoint_wanted_{false};
  std::atomic<bool> rounds_over_{false};  ///< nothing is left to pause
  std::atomic<bool> done_{false};
  std::atomic<bool> failed_{false};
  std::mutex health_mutex_;
  HealthReport health_report_;
  Clock::time_point next_health_;  ///< the worker's: when it reports, if nothing happens before
  std::unique_ptr<Health> health_;
  std::thread worker_;
};

/// Tells whoever follows the run that it cannot go on; takes a second, for them to hear it.
void announceStop(const pmeta::Experiment& experiment, const std::string& why);

}  // namespace pmeta_nodes
