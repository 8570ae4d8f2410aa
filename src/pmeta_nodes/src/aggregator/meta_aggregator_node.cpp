#include "aggregator/meta_aggregator_node.h"

#include <ros/callback_queue.h>
#include <unistd.h>

#include <cmath>
#include <sstream>

#include "common/conversions.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::RoundSummary;
using Verdict = pmeta::MetaAggregator::Verdict;

constexpr std::chrono::duration<double> kTick{0.02};
// agents give a sign of life twice a second
constexpr std::chrono::duration<double> kSilence{1.5};
constexpr std::chrono::duration<double> kStartUp{15};
// for the last messages to reach everybody before the node, and with it the launch, ends
constexpr double kFarewell = 0.5;

constexpr std::chrono::seconds kRetryDisk{2};
// a node that has just started takes no news from before
constexpr std::chrono::seconds kLastWords{2};
constexpr std::size_t kMostReason = 500;  // bytes of a stranger's sentence

bool isTerminal() { return isatty(STDOUT_FILENO) != 0; }

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
  if (log_) console_.recall(log_->dir() + "/rounds.csv");
  summary_.run_id = experiment.settings().run_id;
  summary_.experiment = experiment.settings().experiment;
  summary_.rounds = static_cast<std::uint32_t>(experiment.settings().rounds);
  summary_.personal_return = summary_.meta_return = summary_.test_return = std::nan("");

  const auto queue = static_cast<std::uint32_t>(8 * experiment.totalTasks() + 8);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  meta_pub_ = nh_.advertise<pmeta_msgs::MetaPolicy>("meta_policy", 1, true);
  round_pub_ = nh_.advertise<RoundSummary>("round", 8, true);
  scores_pub_ = nh_.advertise<pmeta_msgs::Scores>("scores", 1, true);
  auxiliary_sub_ = nh_.subscribe<pmeta_msgs::AuxiliaryUpdate>(
      "auxiliary", queue,
      boost::function<void(const pmeta_msgs::AuxiliaryUpdate::Ptr&)>(
          [this](const pmeta_msgs::AuxiliaryUpdate::Ptr& msg) { mailbox_.push(msg); }),
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
            if (msg->run_id != experiment_.settings().run_id) return;
            roll_call_.heard(static_cast<int>(msg->task));
            if (msg->state == pmeta_msgs::AgentStatus::FAILED) mailbox_.push(msg);
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
  std::optional<pmeta::RunLock> lock;
  if (status != "finished") lock.emplace(experiment_.runDir());
  std::vector<std::string> refused;
  const int rounds = experiment_.settings().rounds;
  const auto fresh = [this] {
    aggregator_ = pmeta::MetaAggregator(experiment_);
    book_ = pmeta::RoundBook(experiment_);
    return State{aggregator_, book_};
  };
  const int round = checkpoints_.loadNewest(rounds, fresh, refused);
  for (const std::string& sentence : refused) ROS_WARN("%s", sentence.c_str());
  if (!lock) return nullptr;
  ROS_INFO("going on after round %d.", round);
  return std::make_unique<pmeta::RunLog>(
      pmeta::RunLog::reopen(experiment_, book_.roundsTaken(), std::move(*lock)));
}

MetaAggregatorNode::~MetaAggregatorNode() {
  stop_ = true;
  mailbox_.close();
  if (worker_.joinable()) worker_.join();
}

int MetaAggregatorNode::spin() {
  Clock::time_point next_words = Clock::now();
  while (!stopRequested() && !(done_ && !hold_)) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    if (!done_ || Clock::now() < next_words) continue;
    next_words = Clock::now() + kLastWords;
    repeatLastWords();
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
    if (log_) log_->fail(error.what());
    try {
      publishRound(RoundSummary::STOPPED, error.what());
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
  awaitOnlookers();
  publishRound(RoundSummary::RUNNING, "waiting for the agents' first updates");
  publishMetaPolicy();
  while (!stop_ && (book_.roundsTaken() < rounds || !unwritten_.empty())) {
    if (const auto message = mailbox_.pop(kTick)) take(*message);
    const std::string hopeless = aggregator_.hopeless();
    if (!hopeless.empty()) throw pmeta::Error(hopeless);
    collectCompleteRounds(false);
    writeDown();
    announcePause();
    closeRoundIfDue();
    announceMissing();
    if (Clock::now() >= next_health_) reportHealth();
  }
  rounds_over_ = true;
  if (book_.roundsTaken() < rounds) collectCompleteRounds(true);
  writeDown();
  const bool finished = book_.roundsTaken() == rounds && unwritten_.empty();
  const pmeta::MetaPolicy& meta = aggregator_.metaPolicy();
  if (meta.round > 0) {
    pmeta::saveRunPolicy(experiment_, pmeta::PolicyKind::kMeta, -1, meta.round, meta.model);
  }
  if (finished) {
    log_->finish("finished");
    logLines(console_.table() + "finished; " + pmeta::listRunFolder(dir));
    publishRound(RoundSummary::FINISHED, "all rounds are done; results in " + dir);
  } else {
    log_->finish("stopped");
    publishRound(RoundSummary::STOPPED, "stopped in round " + std::to_string(meta.round + 1));
    ROS_WARN("stopped in round %d; what was done is in %s", meta.round + 1, dir.c_str());
  }
}

void MetaAggregatorNode::take(const Message& message) {
  try {
    if (const auto* update = std::get_if<pmeta_msgs::AuxiliaryUpdate::Ptr>(&message)) {
      takeUpdate(**update);
    } else if (const auto* result = std::get_if<pmeta_msgs::TaskReturn::ConstPtr>(&message)) {
      takeReturn(**result);
    } else {
      takeFailure(*std::get<pmeta_msgs::AgentStatus::ConstPtr>(message));
    }
  } catch (const pmeta::Error& error) {
    refuse(error.what());
  }
}

void MetaAggregatorNode::takeUpdate(pmeta_msgs::AuxiliaryUpdate& msg) {
  const auto task = static_cast<int>(msg.task);
  const std::string forgery = refusals_.judge("an update", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  // a foreign run's blob is not even unpacked
  if (msg.run_id != summary_.run_id) {
    return refuseUpdate(task, "an update belongs to run " + pmeta::shown(msg.run_id) + ", not to " +
                                  pmeta::shown(summary_.run_id) + ".");
  }
  try {
    const auto answer =
        aggregator_.offer(std::make_shared<const pmeta::AuxiliaryUpdate>(fromMsg(std::move(msg))));
    if (answer.verdict == Verdict::kRefused) return refuse(answer.reason);
  } catch (const pmeta::Error& error) {
    return refuseUpdate(task, error.what());
  }
}

void MetaAggregatorNode::takeReturn(const pmeta_msgs::TaskReturn& msg) {
  const std::string forgery = refusals_.judge("a return", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  refusals_.count(book_.add(fromMsg(msg)) ? "returns booked" : "returns not due");
}

void MetaAggregatorNode::takeFailure(const pmeta_msgs::AgentStatus& msg) {
  const std::string forgery =
      refusals_.judge("an agent's failure", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  // one of before this aggregator was started may have been mended since
  if (msg.incarnation != incarnation_) return refusals_.count("failures of before");
  const auto task = static_cast<int>(msg.task);
  if (task < 0 || task >= experiment_.totalTasks()) return refusals_.count("failures of no task");
  const std::string reason = pmeta::plain(msg.message, kMostReason);
  if (aggregator_.giveUp(task, reason)) ROS_ERROR("%s", reason.c_str());
}

void MetaAggregatorNode::refuseUpdate(int task, const std::string& reason) {
  aggregator_.countRefusal(task, reason);
  refuse(reason);
}

void MetaAggregatorNode::refuse(const std::string& reason) {
  ++summary_.refused;
  if (!refusals_.mayTell()) return;
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
    } else {
      pmeta_msgs::Scores scores = toScores(round, experiment_);
      scores.header.stamp = ros::Time::now();
      scores_pub_.publish(scores);
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
  const pmeta::MetaPolicy& meta = aggregator_.metaPolicy();
  auto msg = boost::make_shared<pmeta_msgs::MetaPolicy>(toMsg(meta, rounds));
  // the initial one is never evaluated
  msg->evaluate = static_cast<std::uint8_t>(meta.round > 0 && evaluate_.exchange(false));
  last_is_out_ = meta.round == rounds;
  msg->incarnation = incarnation_;
  const bool checkpoint = checkpoint_wanted_.exchange(false);
  msg->checkpoint = static_cast<std::uint8_t>(checkpoint);
  if (checkpoint) checkpoint_round_ = meta.round + 1;
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

}  // namespace pmeta_nodes
