#pragma once

#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>

#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "common/recent_returns.h"

namespace pmeta_nodes {

/// A return as the panel shows it.
struct ShownReturn {
  /// Undiscounted, in units of reward; NaN: none yet.
  double mean = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t round = 0;  ///< that it is of; 0: none yet
};

/// What is known of a task and its agent.
struct TaskState {
  std::string run_id;                             ///< of the run that all of this is of
  std::string name;                               ///< of the task
  bool is_test = false;                           ///< no personal policy, and no training
  RecentReturns personal;                         ///< on this task
  RecentReturns meta;                             ///< on this task, after the most exploration
  std::optional<pmeta_msgs::AgentStatus> status;  ///< the newest; none before the first
  std::chrono::steady_clock::time_point heard;    ///< when the status came
};

/// What is known of the run that a panel shows: the newest message of each kind, and the texts that
/// are made of them. Plain values, neither ROS's nor Qt's machinery.
struct RunState {
  bool connected = false;                           ///< is there an aggregator that publishes?
  std::optional<pmeta_msgs::RoundSummary> summary;  ///< the newest; none before the first
  std::map<std::uint32_t, TaskState> tasks;         ///< by number

  /// A summary of another run begins anew.
  void take(const pmeta_msgs::RoundSummary& message);
  /// Returns and statuses of another run than the summary's are ignored.
  void take(const pmeta_msgs::TaskReturn& message);
  /// `now`: when it came.
  void take(const pmeta_msgs::AgentStatus& message, std::chrono::steady_clock::time_point now);

  /// Is there a run that has not ended?
  bool active() const;
  bool paused() const;  ///< does an active run wait for somebody to let it go on?

  /// "running", "late", "paused", "finished", "stopped", "lost" (its aggregator has gone) or "no
  /// run".
  std::string stateText() const;
  /// The summary's message, or what to do where there is no run.
  std::string messageText() const;
  /// The policy's mean return as of the last complete round, and its round; NaN and 0 if none.
  ShownReturn shown(const RecentReturns& returns) const;
  std::string tableText() const;    ///< "task, round 12"; "task, rounds 8 to 12" where they differ
  std::string roundText() const;    ///< "round 12 of 40"
  std::string etaText() const;      ///< "1:05 min"; "-" where nothing is known
  std::string missingText() const;  ///< "missing: 0 grid_4x4, 3 grid_7x7"; "" if nobody is
  /// "training 34 %", "waiting", ...; "silent for 12 s" if the agent of an active run is.
  std::string agentText(const TaskState& task, std::chrono::steady_clock::time_point now) const;

 private:
  TaskState* taskOf(std::uint32_t task, const std::string& run_id, const std::string& name);
};

}  // namespace pmeta_nodes
