#include "meta_aggregator_node.h"

#include <ros/callback_queue.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <sstream>
#include <utility>

#include "conversions.h"
#include "node_main.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/policy_file.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using Verdict = pmeta::MetaAggregator::Verdict;

constexpr std::chrono::duration<double> kTick{0.02};
constexpr auto kAnnounceEvery = std::chrono::seconds(5);
// agents give a sign of life twice a second
constexpr std::chrono::duration<double> kSilence{1.5};
constexpr std::chrono::duration<double> kStartUp{15};
// for the last messages to reach everybody before the node, and with it the launch, ends
constexpr double kFarewell = 0.5;

constexpr std::chrono::seconds kRetryDisk{2};
constexpr char kHeld[] = " The run is held until that is mended.";

constexpr char kPaused[] =
    "paused: agents finish the round in hand, the next meta-policy waits until the service pause "
    "is "
    "called with false";

bool isTerminal() { return isatty(STDOUT_FILENO) != 0; }

std::string timeOfDay(std::time_t time) {
  std::tm local{};
  localtime_r(&time, &local);
  char text[16];
  std::strftime(text, sizeof text, "%H:%M:%S", &local);
  return text;
}

// a console line of ours for each line: roslaunch mixes the nodes' output
void logLines(const std::string& text) {
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) ROS_INFO("%s", line.c_str());
}

}  // namespace

MetaAggregatorNode::MetaAggregatorNode(const pmeta::Experiment& experiment, bool hold, bool resume)
    : experiment_(experiment),
      hold_(hold),
      authenticator_(experiment.settings().key_file),
      aggregator_(experiment),
      book_(experiment),
      checkpoints_(experiment, pmeta::kAggregator, aggregator_.metaPolicy().model.layout),
      log_(openLog(resume)),
      console_(experiment, isTerminal()),
      roll_call_(experiment.totalTasks(), kSilence, kStartUp),
      mailbox_(8 * static_cast<std::size_t>(experiment.totalTasks()) + 16) {
  summary_.run_id = experiment.settings().run_id;
  summary_.experiment = experiment.settings().experiment;
  summary_.rounds = static_cast<std::uint32_t>(experiment.settings().rounds);
  summary_.personal_return = summary_.meta_return = summary_.test_return = std::nan("");

  const auto queue = static_cast<std::uint32_t>(8 * experiment.totalTasks() + 8);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  meta_pub_ = nh_.advertise<pmeta_msgs::MetaPolicy>("meta_policy", 1, true);
  round_pub_ = nh_.advertise<RoundSummary>("round", 8, true);
  auxiliary_sub_ = nh_.subscribe<pmeta_msgs::AuxiliaryUpdate>(
      "auxiliary", queue,
      boost::function<void(const pmeta_msgs::AuxiliaryUpdate::ConstPtr&)>(
          [this](const pmeta_msgs::AuxiliaryUpdate::ConstPtr& msg) { mailbox_.push(msg); }),
      ros::VoidConstPtr(), hints);
  returns_sub_ = nh_.subscribe<pmeta_msgs::TaskReturn>(
      "returns", queue,
      boost::function<void(const pmeta_msgs::TaskReturn::ConstPtr&)>(
          [this](const pmeta_msgs::TaskReturn::ConstPtr& msg) { mailbox_.push(msg); }),
      ros::VoidConstPtr(), hints);
  status_sub_ = nh_.subscribe<pmeta_msgs::AgentStatus>(
      "agent_status", queue,
      boost::function<void(const pmeta_msgs::AgentStatus::ConstPtr&)>(
          [this](const pmeta_msgs::AgentStatus::ConstPtr& msg) {
            if (msg->run_id == experiment_.settings().run_id)
              roll_call_.heard(static_cast<int>(msg->task));
          }),
      ros::VoidConstPtr(), hints);
  pause_service_ = nh_.advertiseService("pause", &MetaAggregatorNode::onPause, this);
  evaluate_service_ = nh_.advertiseService("evaluate", &MetaAggregatorNode::onEvaluate, this);
  checkpoint_service_ =
      nh_.advertiseService("save_checkpoint", &MetaAggregatorNode::onSaveCheckpoint, this);
  health_ = std::make_unique<Health>(experiment.settings().experiment, "meta aggregator",
                                     [this] { return health(); });
  worker_ = std::thread([this] { work(); });
}

void MetaAggregatorNode::State::saveState(pmeta::StateWriter& writer) const {
  writer.part("aggregator", aggregator);
  writer.part("book", book);
}

void MetaAggregatorNode::State::loadState(pmeta::StateReader& reader) {
  reader.part("aggregator", aggregator);
  reader.part("book", book);
}

std::unique_ptr<pmeta::RunLog> MetaAggregatorNode::openLog(bool resume) {
  const std::string status = pmeta::runStatus(experiment_.runDir());
  if (!resume || status.empty()) return std::make_unique<pmeta::RunLog>(experiment_);
  std::vector<std::string> refused;
  const int rounds = experiment_.settings().rounds;
  const int round = checkpoints_.newest(rounds, refused);
  for (const std::string& sentence : refused) ROS_WARN("%s", sentence.c_str());
  if (round > 0) {
    State state{aggregator_, book_};
    checkpoints_.load(round, state);
  }
  if (status == "finished") return nullptr;
  ROS_INFO("going on after round %d.", round);
  return std::make_unique<pmeta::RunLog>(pmeta::RunLog::reopen(experiment_, book_.roundsTaken()));
}

MetaAggregatorNode::~MetaAggregatorNode() {
  stop_ = true;
  mailbox_.close();
  if (worker_.joinable()) worker_.join();
}

int MetaAggregatorNode::spin() {
  while (!stopRequested() && !(done_ && !hold_)) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  }
  stop_ = true;
  mailbox_.close();
  worker_.join();
  return failed_ ? 1 : 0;
}

bool MetaAggregatorNode::onPause(std_srvs::SetBool::Request& request,
                                 std_srvs::SetBool::Response& response) {
  response.success = !rounds_over_;
  if (rounds_over_) {
    response.message = "the rounds are over: there is nothing to pause";
    return true;
  }
  paused_ = request.data != 0;
  response.message = paused_ ? kPaused : "running";
  return true;
}

bool MetaAggregatorNode::onEvaluate(std_srvs::Trigger::Request&,
                                    std_srvs::Trigger::Response& response) {
  response.success = !last_is_out_;
  evaluate_ = !last_is_out_;
  response.message = last_is_out_
                         ? "the last meta-policy is out, and is evaluated in any case"
                         : "the next meta-policy is evaluated, and so are the personal policies";
  return true;
}

bool MetaAggregatorNode::onSaveCheckpoint(std_srvs::Trigger::Request&,
                                          std_srvs::Trigger::Response& response) {
  response.success = !rounds_over_;
  checkpoint_wanted_ = !rounds_over_;
  response.message = rounds_over_ ? "the rounds are over: there is nothing to save"
                                  : "all save a checkpoint when the round after this one is done";
  return true;
}

void MetaAggregatorNode::work() {
  try {
    runRounds();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    failed_ = true;
    try {
      publishRound(RoundSummary::STOPPED, error.what());
      if (log_) log_->finish("failed");
    } catch (const std::exception& second) {
      ROS_FATAL("%s", second.what());
    }
  }
  ros::WallDuration(kFarewell).sleep();
  done_ = true;
}

void MetaAggregatorNode::runRounds() {
  const int rounds = experiment_.settings().rounds;
  const int tests = experiment_.numTestTasks();
  const std::string dir = experiment_.runDir();
  if (!log_) {
    rounds_over_ = true;
    publishRound(RoundSummary::FINISHED, "all rounds are done; results in " + dir);
    return;
  }
  ROS_INFO("run %s: %d tasks%s, %d rounds; results in %s", summary_.run_id.c_str(),
           experiment_.numTasks(),
           tests == 0 ? "" : (" and " + std::to_string(tests) + " test tasks").c_str(), rounds,
           dir.c_str());
  publishRound(RoundSummary::RUNNING, "waiting for the agents' first updates");
  publishMetaPolicy();
  while (!stop_ && (book_.roundsTaken() < rounds || !unwritten_.empty())) {
    if (const auto message = mailbox_.pop(kTick)) take(*message);
    collectCompleteRounds(false);
    writeDown();
    announcePause();
    closeRoundIfDue();
    announceMissing();
  }
  rounds_over_ = true;
  if (book_.roundsTaken() < rounds) collectCompleteRounds(true);
  writeDown();
  const bool finished = book_.roundsTaken() == rounds && unwritten_.empty();
  const pmeta::MetaPolicy& meta = aggregator_.metaPolicy();
  if (meta.round > 0) {
    pmeta::saveRunPolicy(experiment_, pmeta::Policy::kMeta, -1, meta.round, meta.model);
  }
  if (finished) {
    log_->finish("finished");
    publishRound(RoundSummary::FINISHED, "all rounds are done; results in " + dir);
    logLines(console_.table() + "finished; " + pmeta::listRunFolder(dir));
  } else {
    log_->finish("stopped");
    publishRound(RoundSummary::STOPPED, "stopped in round " + std::to_string(meta.round + 1));
    ROS_WARN("stopped in round %d; what was done is in %s", meta.round + 1, dir.c_str());
  }
}

void MetaAggregatorNode::take(const Message& message) {
  try {
    if (const auto* update = std::get_if<pmeta_msgs::AuxiliaryUpdate::ConstPtr>(&message)) {
      takeUpdate(**update);
    } else {
      takeReturn(*std::get<pmeta_msgs::TaskReturn::ConstPtr>(message));
    }
  } catch (const pmeta::Error& error) {
    refuse(error.what());
  }
}

void MetaAggregatorNode::takeUpdate(const pmeta_msgs::AuxiliaryUpdate& msg) {
  const std::string forgery = refusals_.judge("an update", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  // a foreign run's blob is not even unpacked
  if (msg.run_id != summary_.run_id) {
    return refuseUpdate(
        msg, "an update belongs to run '" + msg.run_id + "', not to '" + summary_.run_id + "'.");
  }
  try {
    const auto answer =
        aggregator_.offer(std::make_shared<const pmeta::AuxiliaryUpdate>(fromMsg(msg)));
    if (answer.verdict == Verdict::kRefused) return refuse(answer.reason);
  } catch (const pmeta::Error& error) {
    return refuseUpdate(msg, error.what());
  }
  reportHealth();
}

void MetaAggregatorNode::takeReturn(const pmeta_msgs::TaskReturn& msg) {
  const std::string forgery = refusals_.judge("a return", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  refusals_.count(book_.add(fromMsg(msg)) ? "returns booked" : "returns not due");
  reportHealth();
}

void MetaAggregatorNode::refuseUpdate(const pmeta_msgs::AuxiliaryUpdate& msg,
                                      const std::string& reason) {
  aggregator_.countRefusal(static_cast<int>(msg.task), reason);
  refuse(reason);
}

void MetaAggregatorNode::refuse(const std::string& reason) {
  ++summary_.refused;
  if (!refusals_.mayTell()) return reportHealth();
  const std::string told = "refused: " + reason + refusals_.untold();
  ROS_WARN("%s", told.c_str());
  publishRound(RoundSummary::RUNNING, told);
}

double MetaAggregatorNode::roundSeconds() const {
  return std::chrono::duration<double>(Clock::now() - round_start_).count();
}

void MetaAggregatorNode::closeRoundIfDue() {
  const pmeta::ExperimentSettings& settings = experiment_.settings();
  const int round = aggregator_.metaPolicy().round + 1;
  const bool late = roundSeconds() > settings.aggregation.round_timeout &&
                    experiment_.quorum() < experiment_.numTasks();
  if (round > settings.rounds) {
    // only returns of the last meta-policy are still out
    if (late) collectCompleteRounds(true);
    return;
  }
  // what is done comes first to the disk
  if (unpublished_ || !unwritten_.empty()) return;
  if (roundSeconds() < settings.pace) return;
  // a full round waits for the returns too: whoever is killed and comes back can still send them
  const bool complete =
      aggregator_.complete() && book_.roundsTaken() == round - 1 && book_.hasPersonal(round);
  if (!complete && !(late && aggregator_.hasQuorum())) return;
  if (paused_) {
    if (!held_since_) held_since_ = Clock::now();
    return;
  }
  const Clock::time_point due = held_since_.value_or(Clock::now());
  const double seconds = std::chrono::duration<double>(due - round_start_).count();
  collectCompleteRounds(true);
  const std::vector<int> missing = aggregator_.closeRound();
  if (!missing.empty()) {
    ROS_WARN("round %d was closed by quorum without %s.", round, taskNames(missing).c_str());
  }
  for (const auto& exclusion : aggregator_.exclusions()) {
    ROS_WARN("round %d leaves out the update of %s: %s.", round,
             taskNames({exclusion.task}).c_str(), exclusion.reason.c_str());
  }
  book_.closeRound(round, aggregator_.metaPolicy().participants, missing, seconds,
                   aggregator_.excluded());
  unpublished_ = true;
  next_attempt_ = Clock::now();
  writeDown();
}

void MetaAggregatorNode::collectCompleteRounds(bool force) {
  for (pmeta::RoundBook::Round& round : book_.take(force)) {
    const RoundSummary before = summary_;
    summary_ = toMsg(round.summary, experiment_);
    summary_.refused = before.refused;
    if (round.rows.empty()) {
      // not evaluated: the last returns still are the newest
      summary_.personal_return = before.personal_return;
      summary_.meta_return = before.meta_return;
      summary_.test_return = before.test_return;
    }
    const std::vector<int>& excluded = round.summary.excluded;
    publishRound(
        RoundSummary::RUNNING,
        "round " + std::to_string(round.summary.round) + " is complete" +
            (excluded.empty() ? "" : "; the updates left out are those of " + taskNames(excluded)));
    const std::string line = console_.take(round);
    if (!line.empty()) ROS_INFO("%s", line.c_str());
    unwritten_.push_back(std::move(round));
  }
}

// what the disk refuses is kept and tried again: nothing goes on without it
void MetaAggregatorNode::writeDown() {
  if (unwritten_.empty() && !unpublished_) return;
  if (!disk_trouble_.empty() && Clock::now() < next_attempt_ && !stop_) return;
  try {
    for (; !unwritten_.empty(); unwritten_.pop_front()) log_->write(unwritten_.front());
    if (unpublished_) {
      saveCheckpoint();
      unpublished_ = false;
      publishMetaPolicy();
    }
    if (!disk_trouble_.empty()) {
      disk_trouble_.clear();
      ROS_INFO("the results can be written again; the run goes on.");
      publishRound(RoundSummary::RUNNING, "running");
    }
  } catch (const pmeta::Error& error) {
    next_attempt_ = Clock::now() + kRetryDisk;
    if (disk_trouble_ == error.what()) return;
    disk_trouble_ = error.what();
    ROS_ERROR("%s The run is held until that is mended; it is tried again every %d s.",
              error.what(), static_cast<int>(kRetryDisk.count()));
    publishRound(RoundSummary::RUNNING, "");
  }
}

void MetaAggregatorNode::saveCheckpoint() {
  const int round = aggregator_.metaPolicy().round;
  if (!experiment_.checkpointsAfter(round) && round != checkpoint_round_) return;
  log_->sync();
  checkpoints_.save(round, State{aggregator_, book_});
}

void MetaAggregatorNode::publishMetaPolicy() {
  const int rounds = experiment_.settings().rounds;
  pmeta::MetaPolicy meta = aggregator_.metaPolicy();
  // the initial one is never evaluated
  meta.evaluate = meta.round > 0 && evaluate_.exchange(false);
  last_is_out_ = meta.round == rounds;
  meta.incarnation = incarnation_;
  meta.checkpoint = checkpoint_wanted_.exchange(false);
  if (meta.checkpoint) checkpoint_round_ = meta.round + 1;
  auto msg = boost::make_shared<pmeta_msgs::MetaPolicy>(toMsg(meta, rounds));
  msg->header.stamp = ros::Time::now();
  sign(authenticator_, *msg);
  meta_msg_ = msg;
  meta_pub_.publish(meta_msg_);
  round_start_ = Clock::now();
  held_since_.reset();
  next_announcement_ =
      round_start_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
                         experiment_.settings().aggregation.round_timeout));
}

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
  summary_.header.stamp = ros::Time::now();
  const std::vector<std::uint32_t> of_last_round = summary_.missing;
  if (silent) summary_.missing.assign(silent_.begin(), silent_.end());
  sign(authenticator_, summary_);
  round_pub_.publish(summary_);
  summary_.missing = of_last_round;
  reportHealth();
}

void MetaAggregatorNode::reportHealth() {
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
  summary.message = why;
  summary.header.stamp = ros::Time::now();
  sign(pmeta::Authenticator(experiment.settings().key_file), summary);
  publisher.publish(summary);
  ros::WallDuration(1).sleep();
}

}  // namespace pmeta_nodes
