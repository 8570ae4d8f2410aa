#include "panel/run_state.h"

#include <boost/make_shared.hpp>

#include <algorithm>
#include <vector>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/settings.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;
using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;

// a status comes about once a second
constexpr auto kSilence = std::chrono::seconds(5);

std::string trainingText(const AgentStatus& status) {
  if (status.updates_per_round == 0) return "training";
  return "training " + std::to_string(100ull * status.update / status.updates_per_round) + " %";
}

}  // namespace

TaskState* RunState::taskOf(std::uint32_t task, const std::string& run_id,
                            const std::string& name) {
  if (summary && summary->run_id != run_id) return nullptr;
  TaskState& state = tasks[task];
  if (state.run_id != run_id) state = TaskState();
  state.run_id = run_id;
  state.name = name;
  return &state;
}

void RunState::take(const RoundSummary& message) {
  if (!summary || summary->run_id != message.run_id) {
    for (auto it = tasks.begin(); it != tasks.end();) {
      it = it->second.run_id == message.run_id ? std::next(it) : tasks.erase(it);
    }
  }
  summary = message;
}

void RunState::take(const TaskReturn& message) {
  TaskState* task = taskOf(message.task, message.run_id, message.task_name);
  if (task == nullptr) return;
  task->is_test = message.split == TaskReturn::TEST;
  (message.policy == TaskReturn::META ? task->meta : task->personal)
      .take(boost::make_shared<const TaskReturn>(message));
}

void RunState::take(const AgentStatus& message, std::chrono::steady_clock::time_point now) {
  TaskState* task = taskOf(message.task, message.run_id, message.task_name);
  if (task == nullptr) return;
  task->status = message;
  task->heard = now;
}

bool RunState::active() const {
  return connected && summary && summary->state != RoundSummary::FINISHED &&
         summary->state != RoundSummary::STOPPED;
}

bool RunState::paused() const { return active() && summary->state == RoundSummary::PAUSED; }

std::string RunState::stateText() const {
  if (!summary) return "no run";
  switch (summary->state) {
    case RoundSummary::FINISHED:
      return "finished";
    case RoundSummary::STOPPED:
      return "stopped";
    default:
      break;
  }
  if (!connected) return "lost";
  if (summary->state == RoundSummary::LATE) return "late";
  return summary->state == RoundSummary::PAUSED ? "paused" : "running";
}

std::string RunState::messageText() const {
  if (!summary && !connected) return "no run on /pmeta: start one with ./pmeta run";
  if (!summary) return "waiting for the aggregator's first message";
  if (stateText() == "lost") {
    return "the aggregator has gone before its last round: see the terminal of ./pmeta run";
  }
  return summary->message;
}

ShownReturn RunState::shown(const RecentReturns& returns) const {
  const auto result =
      returns.upTo(summary ? summary->round : std::numeric_limits<std::uint32_t>::max());
  return result ? ShownReturn{result->return_mean, result->round} : ShownReturn();
}

std::string RunState::tableText() const {
  std::uint32_t first = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t last = 0;
  for (const auto& task : tasks) {
    for (const RecentReturns* returns : {&task.second.personal, &task.second.meta}) {
      const std::uint32_t round = shown(*returns).round;
      if (round == 0) continue;
      first = std::min(first, round);
      last = std::max(last, round);
    }
  }
  if (last == 0) return "task";
  if (first == last) return "task, round " + std::to_string(last);
  return "task, rounds " + std::to_string(first) + " to " + std::to_string(last);
}

std::string RunState::roundText() const {
  if (!summary) return "";
  return "round " + std::to_string(summary->round) + " of " + std::to_string(summary->rounds);
}

std::string RunState::etaText() const {
  if (!active() || summary->round == 0) return "-";
  return pmeta::duration(summary->eta_s);
}

std::string RunState::missingText() const {
  if (!summary || summary->missing.empty()) return "";
  std::vector<std::string> names;
  for (const std::uint32_t task : summary->missing) {
    const auto it = tasks.find(task);
    names.push_back(std::to_string(task) + (it == tasks.end() ? "" : " " + it->second.name));
  }
  return "missing: " + pmeta::join(names);
}

std::string RunState::agentText(const TaskState& task,
                                std::chrono::steady_clock::time_point now) const {
  if (!task.status) return "-";
  const auto silent = now - task.heard;
  if (active() && silent > kSilence) {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(silent).count();
    return "silent for " + std::to_string(seconds) + " s";
  }
  switch (task.status->state) {
    case AgentStatus::WAITING:
      return "waiting";
    case AgentStatus::TRAINING:
      return trainingText(*task.status);
    case AgentStatus::EVALUATING:
      return "evaluating";
    case AgentStatus::DONE:
      return "done";
    case AgentStatus::FAILED:
      return "failed";
    default:
      return "-";
  }
}

}  // namespace pmeta_nodes
