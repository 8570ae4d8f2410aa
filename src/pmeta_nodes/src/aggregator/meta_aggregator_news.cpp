// What the aggregator tells people: the state of the run, who is missing, its health.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <utility>

#include "aggregator/meta_aggregator_node.h"
#include "aggregator/onlookers.h"
#include "common/conversions.h"
#include "common/private_param.h"
#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;

constexpr auto kAnnounceEvery = std::chrono::seconds(5);
constexpr auto kHealthEvery = std::chrono::milliseconds(500);
constexpr std::chrono::seconds kOnlookersWithin{30};
constexpr std::chrono::milliseconds kLookAgain{100};
constexpr char kHeld[] = " The run is held until that is mended.";

std::string timeOfDay(std::time_t time) {
  std::tm local{};
  localtime_r(&time, &local);
  char text[16];
  std::strftime(text, sizeof text, "%H:%M:%S", &local);
  return text;
}

}  // namespace

const char MetaAggregatorNode::kPaused[] =
    "paused: agents finish the round in hand, the next meta-policy waits until the service pause "
    "is called with false";

void MetaAggregatorNode::publishRound(std::uint8_t state, const std::string& message) {
  const bool paused = pause_announced_ && state == RoundSummary::RUNNING;
  const bool blocked = !disk_trouble_.empty() && state == RoundSummary::RUNNING;
  const bool silent = !silent_.empty() && !paused && !blocked && state == RoundSummary::RUNNING;
  if (silent) state = RoundSummary::LATE;
  if (blocked) state = RoundSummary::BLOCKED;
  summary_.state = paused && !blocked ? static_cast<std::uint8_t>(RoundSummary::PAUSED) : state;
  summary_.message = blocked  ? disk_trouble_ + kHeld
                     : paused ? kPaused + (message.empty() ? "" : "; " + message)
                     : silent ? silenceText() + "; " + message
                              : message;
  summary_.state_name = stateName(summary_);
  summary_.header.stamp = ros::Time::now();
  const std::vector<std::uint32_t> of_last_round = summary_.missing;
  if (silent) summary_.missing.assign(silent_.begin(), silent_.end());
  sign(authenticator_, summary_);
  round_pub_.publish(summary_);
  summary_.missing = of_last_round;
  reportHealth();
}

// when the run's state changes and twice a second, not for each message: it writes many words
void MetaAggregatorNode::reportHealth() {
  next_health_ = Clock::now() + kHealthEvery;
  const std::uint8_t state = summary_.state;
  const std::lock_guard<std::mutex> lock(health_mutex_);
  health_report_ = {};
  health_report_.level = state == RoundSummary::LATE ? HealthReport::kWarn
                         : state == RoundSummary::STOPPED || state == RoundSummary::BLOCKED
                             ? HealthReport::kError
                             : HealthReport::kOk;
  health_report_.summary = summary_.message;
  health_report_.values = {{"rounds complete", std::to_string(summary_.round)},
                           {"rounds in all", std::to_string(summary_.rounds)},
                           {"broken episodes", std::to_string(book_.brokenEpisodes())},
                           {"refused", std::to_string(summary_.refused)}};
  for (int task = 0; task < experiment_.numTasks(); ++task) {
    const auto& counts = aggregator_.counts()[task];
    health_report_.values.emplace_back(
        experiment_.family().taskName(task),
        std::to_string(counts.accepted) + " accepted, " + std::to_string(counts.duplicate) +
            " duplicate, " + std::to_string(counts.stale) + " stale, " +
            std::to_string(counts.refused) + " refused, " + std::to_string(counts.excluded) +
            " left out" +
            (counts.last_reason.empty() ? "" : "; last reason: " + counts.last_reason));
  }
  for (auto& value : refusals_.values()) health_report_.values.push_back(std::move(value));
}

// the worker, whose the summary is, has ended
void MetaAggregatorNode::repeatLastWords() {
  summary_.header.stamp = ros::Time::now();
  sign(authenticator_, summary_);
  round_pub_.publish(summary_);
}

void MetaAggregatorNode::announcePause() {
  // past the last aggregation only returns are out, and nothing is held back
  const bool paused = paused_ && aggregator_.metaPolicy().round < experiment_.settings().rounds;
  if (paused == pause_announced_) return;
  pause_announced_ = paused;
  publishRound(RoundSummary::RUNNING, paused ? "" : "running");
  if (paused) {
    ROS_INFO("%s", kPaused);
  } else {
    ROS_INFO("the run goes on.");
  }
}

void MetaAggregatorNode::awaitOnlookers() {
  const Onlookers onlookers(privateFlag("await_viewer", false),
                            privateFlag("await_recorder", false), experiment_.totalTasks());
  const Clock::time_point limit = Clock::now() + kOnlookersWithin;
  const std::string round = "round " + std::to_string(roundInHand());
  std::string missing;
  std::string told;
  while (!stop_ && !(missing = onlookers.missing()).empty() && Clock::now() < limit) {
    if (missing != told) {
      const std::string text = round + " waits for " + missing + ", " +
                               std::to_string(kOnlookersWithin.count()) + " s at most";
      ROS_INFO("%s", text.c_str());
      publishRound(RoundSummary::RUNNING, text);
      told = missing;
    }
    std::this_thread::sleep_for(kLookAgain);
  }
  if (!missing.empty() && !stop_)
    ROS_WARN("%s goes on without %s.", round.c_str(), missing.c_str());
  // an aggregator that is started again finds them there, or closed for good
  ros::NodeHandle own("~");
  own.setParam("await_viewer", false);
  own.setParam("await_recorder", false);
}

void MetaAggregatorNode::announceMissing() {
  const std::vector<int> silent = roll_call_.silent();
  if (silent != silent_) {
    const bool any = !silent.empty();
    const std::vector<int> before = std::exchange(silent_, silent);
    std::vector<int> back;
    std::set_difference(before.begin(), before.end(), silent.begin(), silent.end(),
                        std::back_inserter(back));
    if (!back.empty()) ROS_INFO("%s: heard of again.", taskNames(back).c_str());
    if (any) ROS_WARN("%s; %s", silenceText().c_str(), waitText().c_str());
    publishRound(RoundSummary::RUNNING, any ? waitText() : "running");
  }
  // who is paused waits for nobody
  if (pause_announced_ || Clock::now() < next_announcement_) return;
  next_announcement_ = Clock::now() + kAnnounceEvery;
  // an update may be in and only a return missing
  const std::vector<int> missing = aggregator_.complete() ? book_.awaited() : aggregator_.missing();
  if (missing.empty()) return;
  const std::string message = "round " + std::to_string(roundInHand()) + " has waited " +
                              std::to_string(std::lround(roundSeconds())) + " s for " +
                              taskNames(missing) + "; " + waitText();
  const std::vector<std::uint32_t> of_last_round = summary_.missing;
  summary_.missing.assign(missing.begin(), missing.end());
  publishRound(RoundSummary::LATE, message);
  summary_.missing = of_last_round;
  // forged ones may have pushed it out of somebody's queue
  if (authenticator_.hasKey()) meta_pub_.publish(meta_msg_);
  ROS_WARN("%s", message.c_str());
}

int MetaAggregatorNode::roundInHand() const {
  return std::min(aggregator_.metaPolicy().round + 1, experiment_.settings().rounds);
}

// who is missing, since when
std::string MetaAggregatorNode::silenceText() const {
  std::vector<std::string> words;
  for (const int task : silent_) {
    const std::time_t since =
        std::time(nullptr) - static_cast<std::time_t>(std::lround(roll_call_.silence(task)));
    words.push_back(taskNames({task}) +
                    (roll_call_.known(task) ? " is silent since " : " has not shown up since ") +
                    timeOfDay(since));
  }
  return pmeta::join(words);
}

// what happens next
std::string MetaAggregatorNode::waitText() const {
  const std::string round = "round " + std::to_string(roundInHand());
  const int tasks = experiment_.numTasks();
  if (experiment_.quorum() >= tasks) {
    return round + " waits until all " + std::to_string(tasks) + " tasks have reported";
  }
  const double left = experiment_.settings().aggregation.round_timeout - roundSeconds();
  const std::string enough = std::to_string(experiment_.quorum()) + " of " + std::to_string(tasks) +
                             " tasks have reported";
  return round + " goes on without them " +
         (left > 0 ? "in " + std::to_string(std::lround(left)) + " s if " : "once ") + enough;
}

std::string MetaAggregatorNode::taskNames(const std::vector<int>& tasks) const {
  std::vector<std::string> names;
  for (const int task : tasks) {
    names.push_back("task " + std::to_string(task) + " (" + experiment_.family().taskName(task) +
                    ")");
  }
  return pmeta::join(names);
}

HealthReport MetaAggregatorNode::health() {
  const std::lock_guard<std::mutex> lock(health_mutex_);
  return health_report_;
}

void announceStop(const pmeta::Experiment& experiment, const std::string& why) {
  ros::NodeHandle nh;
  const ros::Publisher publisher = nh.advertise<RoundSummary>("round", 1, true);
  RoundSummary summary;
  summary.run_id = experiment.settings().run_id;
  summary.experiment = experiment.settings().experiment;
  summary.rounds = static_cast<std::uint32_t>(experiment.settings().rounds);
  summary.personal_return = summary.meta_return = summary.test_return = std::nan("");
  summary.state = RoundSummary::STOPPED;
  summary.state_name = stateName(summary);
  summary.message = why;
  summary.header.stamp = ros::Time::now();
  sign(pmeta::Authenticator(experiment.settings().key_file), summary);
  publisher.publish(summary);
  ros::WallDuration(1).sleep();
}

}  // namespace pmeta_nodes
