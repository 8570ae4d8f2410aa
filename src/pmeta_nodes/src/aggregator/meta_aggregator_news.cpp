// What the aggregator tells people: the rounds, how the run stands, its health.
#include <cmath>
#include <sstream>

#include "aggregator/meta_aggregator_node.h"
#include "aggregator/onlookers.h"
#include "common/conversions.h"
#include "common/private_param.h"
#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

using pmeta::RunStanding;
using pmeta_msgs::RoundSummary;

constexpr auto kHealthEvery = std::chrono::milliseconds(500);
constexpr std::chrono::seconds kOnlookersWithin{30};
constexpr std::chrono::milliseconds kLookAgain{100};

std::uint8_t stateOf(const RunStanding& standing) {
  switch (standing.state) {
    case RunStanding::State::kLate:
      return RoundSummary::LATE;
    case RunStanding::State::kPaused:
      return RoundSummary::PAUSED;
    case RunStanding::State::kBlocked:
      return RoundSummary::BLOCKED;
    case RunStanding::State::kFinished:
      return RoundSummary::FINISHED;
    case RunStanding::State::kStopped:
      return RoundSummary::STOPPED;
    default:
      return RoundSummary::RUNNING;
  }
}

}  // namespace

void MetaAggregatorNode::showRound(const pmeta::RoundBook::Round& round) {
  const RoundSummary before = summary_;
  summary_ = toMsg(round.summary, experiment_);
  summary_.refused = before.refused;
  if (round.rows.empty()) {
    // not evaluated: the last returns still are the newest
    summary_.personal_return = before.personal_return;
    summary_.meta_return = before.meta_return;
    summary_.test_return = before.test_return;
  } else {
    pmeta_msgs::Scores scores = toScores(round, experiment_);
    scores.header.stamp = ros::Time::now();
    scores_pub_.publish(scores);
  }
  const std::string line = console_.take(round);
  if (!line.empty()) ROS_INFO("%s", line.c_str());
}

void MetaAggregatorNode::tell(const RunStanding& standing) {
  summary_.state = stateOf(standing);
  summary_.message = standing.message;
  const std::vector<std::uint32_t> of_last_round = summary_.missing;
  if (!standing.missing.empty()) {
    summary_.missing.assign(standing.missing.begin(), standing.missing.end());
  }
  publishSummary();
  summary_.missing = of_last_round;
  reportHealth();
}

void MetaAggregatorNode::log(Level level, const std::string& sentence) {
  switch (level) {
    case Level::kInfo:
      ROS_INFO("%s", sentence.c_str());
      break;
    case Level::kWarning:
      ROS_WARN("%s", sentence.c_str());
      break;
    case Level::kError:
      ROS_ERROR("%s", sentence.c_str());
      break;
  }
}

void MetaAggregatorNode::publishSummary() {
  summary_.state_name = stateName(summary_);
  summary_.header.stamp = ros::Time::now();
  sign(authenticator_, summary_);
  round_pub_.publish(summary_);
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
                           {"broken episodes", std::to_string(driver_->book().brokenEpisodes())},
                           {"refused", std::to_string(summary_.refused)}};
  for (int party = 0; party < experiment_.participants(); ++party) {
    const auto& counts = driver_->aggregator().counts()[party];
    health_report_.values.emplace_back(
        experiment_.hasMetaLearner() ? experiment_.settings().algorithm
                                     : experiment_.family().taskName(party),
        std::to_string(counts.accepted) + " accepted, " + std::to_string(counts.duplicate) +
            " duplicate, " + std::to_string(counts.stale) + " stale, " +
            std::to_string(counts.refused) + " refused, " + std::to_string(counts.excluded) +
            " left out" +
            (counts.last_reason.empty() ? "" : "; last reason: " + counts.last_reason));
  }
  for (auto& value : refusals_.values()) health_report_.values.push_back(std::move(value));
}

HealthReport MetaAggregatorNode::health() {
  const std::lock_guard<std::mutex> lock(health_mutex_);
  return health_report_;
}

void MetaAggregatorNode::awaitOnlookers() {
  const Onlookers onlookers(privateFlag("await_viewer", false),
                            privateFlag("await_recorder", false), experiment_.totalTasks());
  const Clock::time_point limit = Clock::now() + kOnlookersWithin;
  const std::string round = "round " + std::to_string(driver_->roundInHand());
  std::string missing;
  std::string told;
  while (!stop_ && !(missing = onlookers.missing()).empty() && Clock::now() < limit) {
    if (missing != told) {
      const std::string text = round + " waits for " + missing + ", " +
                               std::to_string(kOnlookersWithin.count()) + " s at most";
      ROS_INFO("%s", text.c_str());
      driver_->say(text, Clock::now());
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

RoundSummary summaryBefore(const pmeta::Experiment& experiment) {
  RoundSummary summary;
  summary.run_id = experiment.settings().run_id;
  summary.experiment = experiment.settings().experiment;
  summary.rounds = static_cast<std::uint32_t>(experiment.settings().rounds);
  summary.personal_return = summary.meta_return = summary.test_return = std::nan("");
  return summary;
}

void announceStop(const pmeta::Experiment& experiment, const std::string& why) {
  ros::NodeHandle nh;
  const ros::Publisher publisher = nh.advertise<RoundSummary>("round", 1, true);
  RoundSummary summary = summaryBefore(experiment);
  summary.state = RoundSummary::STOPPED;
  summary.state_name = stateName(summary);
  summary.message = why;
  summary.header.stamp = ros::Time::now();
  sign(pmeta::Authenticator(experiment.settings().key_file), summary);
  publisher.publish(summary);
  ros::WallDuration(1).sleep();
}

}  // namespace pmeta_nodes
