#include "aggregator/meta_aggregator_node.h"

#include <ros/callback_queue.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <unistd.h>

#include <functional>
#include <sstream>

#include "common/conversions.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta_nodes {
namespace {

using pmeta::RunStanding;
using pmeta_msgs::RoundSummary;
using Answer = pmeta::RoundDriver::Answer;
using Clock = pmeta::RoundDriver::Clock;

constexpr std::chrono::duration<double> kTick{0.02};
constexpr double kSilence = 1.5;  // agents give a sign of life twice a second
constexpr double kStartUp = 15;
// for the last messages to reach everybody before the node, and with it the launch, ends
constexpr double kFarewell = 0.5;
// a node that has just started takes no news from before
constexpr std::chrono::seconds kLastWords{2};
constexpr std::size_t kMostReason = 500;  // bytes of a stranger's sentence

bool isTerminal() { return isatty(STDOUT_FILENO) != 0; }

// a console line of ours for each line: roslaunch mixes the nodes' output
void logLines(const std::string& text) {
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) ROS_INFO("%s", line.c_str());
}

pmeta::RoundTimes timesOf(const pmeta::Experiment& experiment) {
  const pmeta::ExperimentSettings& settings = experiment.settings();
  return {settings.pace, settings.aggregation.round_timeout, kSilence, kStartUp};
}

template <class Service>
ros::ServiceServer offer(ros::NodeHandle& nh, const std::string& name,
                         const std::function<Answer(const typename Service::Request&)>& answer) {
  return nh.advertiseService<typename Service::Request, typename Service::Response>(
      name, [answer](typename Service::Request& request, typename Service::Response& response) {
        Answer given = answer(request);
        response.success = static_cast<std::uint8_t>(given.taken);
        response.message = std::move(given.message);
        return true;
      });
}

}  // namespace

MetaAggregatorNode::MetaAggregatorNode(const pmeta::Experiment& experiment, bool hold, bool resume)
    : experiment_(experiment),
      hold_(hold),
      authenticator_(experiment.settings().key_file),
      driver_(std::in_place, experiment, timesOf(experiment), *this, Clock::now()),
      checkpoints_(experiment, pmeta::kAggregator, driver_->aggregator().metaPolicy().model.layout),
      keeper_(experiment),
      log_(openLog(resume)),
      console_(experiment, isTerminal()),
      summary_(summaryBefore(experiment)),
      mailbox_(8 * static_cast<std::size_t>(experiment.totalTasks()) + 16) {
  if (log_) console_.recall(log_->dir() + "/rounds.csv");
  meta_pub_ = nh_.advertise<pmeta_msgs::MetaPolicy>("meta_policy", 1, true);
  round_pub_ = nh_.advertise<RoundSummary>("round", 8, true);
  scores_pub_ = nh_.advertise<pmeta_msgs::Scores>("scores", 1, true);
  subscribe();
  offerServices();
  health_ = std::make_unique<Health>(experiment.settings().experiment, "meta aggregator",
                                     [this] { return health(); });
  worker_ = std::thread([this] { work(); });
}

std::unique_ptr<pmeta::RunLog> MetaAggregatorNode::openLog(bool resume) {
  const std::string status = pmeta::runStatus(experiment_.runDir());
  if (!resume || status.empty()) return std::make_unique<pmeta::RunLog>(experiment_);
  std::optional<pmeta::RunLock> lock;
  if (status != "finished") lock.emplace(experiment_.runDir());
  std::vector<std::string> refused;
  const auto fresh = [this]() -> pmeta::RoundDriver& {
    return driver_.emplace(experiment_, timesOf(experiment_), *this, Clock::now());
  };
  const int round = checkpoints_.loadNewest(experiment_.settings().rounds, fresh, refused);
  for (const std::string& sentence : refused) ROS_WARN("%s", sentence.c_str());
  if (!lock) return nullptr;
  ROS_INFO("going on after round %d.", round);
  return std::make_unique<pmeta::RunLog>(
      pmeta::RunLog::reopen(experiment_, driver_->book().roundsTaken(), std::move(*lock)));
}

void MetaAggregatorNode::subscribe() {
  const auto queue = static_cast<std::uint32_t>(8 * experiment_.totalTasks() + 8);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  subscribers_.push_back(nh_.subscribe<pmeta_msgs::AuxiliaryUpdate>(
      "auxiliary", queue,
      boost::function<void(const pmeta_msgs::AuxiliaryUpdate::Ptr&)>(
          [this](const pmeta_msgs::AuxiliaryUpdate::Ptr& msg) { mailbox_.push(msg); }),
      ros::VoidConstPtr(), hints));
  subscribers_.push_back(nh_.subscribe<pmeta_msgs::TaskReturn>(
      "returns", queue,
      boost::function<void(const pmeta_msgs::TaskReturn::ConstPtr&)>(
          [this](const pmeta_msgs::TaskReturn::ConstPtr& msg) { mailbox_.push(msg); }),
      ros::VoidConstPtr(), hints));
  subscribers_.push_back(nh_.subscribe<pmeta_msgs::AgentStatus>(
      "agent_status", queue,
      boost::function<void(const pmeta_msgs::AgentStatus::ConstPtr&)>(
          [this](const pmeta_msgs::AgentStatus::ConstPtr& msg) {
            if (msg->run_id != experiment_.settings().run_id) return;
            driver_->heard(static_cast<int>(msg->task), Clock::now());
            if (msg->state == pmeta_msgs::AgentStatus::FAILED) mailbox_.push(msg);
          }),
      ros::VoidConstPtr(), hints));
}

void MetaAggregatorNode::offerServices() {
  using std_srvs::SetBool;
  using std_srvs::Trigger;
  services_ = {
      offer<SetBool>(nh_, "pause",
                     [this](const auto& request) { return driver_->pause(request.data != 0); }),
      offer<Trigger>(nh_, "evaluate", [this](const auto&) { return driver_->askForEvaluation(); }),
      offer<Trigger>(nh_, "save_checkpoint",
                     [this](const auto&) { return driver_->askForCheckpoint(); })};
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
    publishSummary();  // the worker, whose it is, has ended
  }
  stop_ = true;
  mailbox_.close();
  worker_.join();
  return failed_ ? 1 : 0;
}

void MetaAggregatorNode::work() {
  try {
    runRounds();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    failed_ = true;
    if (log_) log_->fail(error.what());
    try {
      tell({RunStanding::State::kStopped, error.what(), {}});
    } catch (const std::exception& second) {
      ROS_FATAL("%s", second.what());
    }
  }
  ros::WallDuration(kFarewell).sleep();
  done_ = true;
}

void MetaAggregatorNode::runRounds() {
  const std::string dir = experiment_.runDir();
  if (!log_) {
    driver_->endRequests();
    tell({RunStanding::State::kFinished, "all rounds are done; results in " + dir, {}});
    return;
  }
  const int tests = experiment_.numTestTasks();
  ROS_INFO("run %s: %d tasks%s, %d rounds; results in %s", summary_.run_id.c_str(),
           experiment_.numTasks(),
           tests == 0 ? "" : (" and " + std::to_string(tests) + " test tasks").c_str(),
           experiment_.settings().rounds, dir.c_str());
  awaitOnlookers();
  driver_->say("waiting for the agents' first updates", Clock::now());
  driver_->begin(Clock::now());
  while (!stop_ && !driver_->done()) {
    if (const auto message = mailbox_.pop(kTick)) take(*message);
    driver_->step(Clock::now());
    if (Clock::now() >= next_health_) reportHealth();
  }
  endRounds();
}

void MetaAggregatorNode::endRounds() {
  const bool finished = driver_->end(Clock::now());
  const std::string dir = experiment_.runDir();
  const pmeta::MetaPolicy& meta = driver_->aggregator().metaPolicy();
  if (meta.round > 0) keeper_.saveLast(meta);
  log_->finish(finished ? "finished" : "stopped");
  if (finished) {
    logLines(console_.table() + "finished; " + pmeta::listRunFolder(dir));
    tell({RunStanding::State::kFinished, "all rounds are done; results in " + dir, {}});
  } else {
    const std::string where = "stopped in round " + std::to_string(meta.round + 1);
    tell({RunStanding::State::kStopped, where, {}});
    ROS_WARN("%s; what was done is in %s", where.c_str(), dir.c_str());
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
        driver_->offer(std::make_shared<const pmeta::AuxiliaryUpdate>(fromMsg(std::move(msg))));
    if (answer.verdict == pmeta::MetaAggregator::Verdict::kRefused) return refuse(answer.reason);
  } catch (const pmeta::Error& error) {
    return refuseUpdate(task, error.what());
  }
}

void MetaAggregatorNode::takeReturn(const pmeta_msgs::TaskReturn& msg) {
  const std::string forgery = refusals_.judge("a return", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  refusals_.count(driver_->add(fromMsg(msg)) ? "returns booked" : "returns not due");
}

void MetaAggregatorNode::takeFailure(const pmeta_msgs::AgentStatus& msg) {
  const std::string forgery =
      refusals_.judge("an agent's failure", authenticate(authenticator_, msg));
  if (!forgery.empty()) return refuse(forgery);
  // one of before this aggregator was started may have been mended since
  if (msg.incarnation != incarnation_) return refusals_.count("failures of before");
  const auto task = static_cast<int>(msg.task);
  if (task < 0 || task >= experiment_.totalTasks()) return refusals_.count("failures of no task");
  driver_->giveUp(task, pmeta::plain(msg.message, kMostReason));
}

void MetaAggregatorNode::refuseUpdate(int task, const std::string& reason) {
  driver_->countRefusal(task, reason);
  refuse(reason);
}

void MetaAggregatorNode::refuse(const std::string& reason) {
  ++summary_.refused;
  if (!refusals_.mayTell()) return;
  const std::string told = "refused: " + reason + refusals_.untold();
  ROS_WARN("%s", told.c_str());
  driver_->say(told, Clock::now());
}

// what the driver asks for

void MetaAggregatorNode::publish(const pmeta::MetaPolicy& meta) {
  auto msg = boost::make_shared<pmeta_msgs::MetaPolicy>(toMsg(meta, experiment_.settings().rounds));
  msg->incarnation = incarnation_;
  msg->header.stamp = ros::Time::now();
  sign(authenticator_, *msg);
  meta_msg_ = msg;
  meta_pub_.publish(meta_msg_);
}

// it is latched: only forged ones may have pushed it out of somebody's queue
void MetaAggregatorNode::repeatMetaPolicy() {
  if (authenticator_.hasKey()) meta_pub_.publish(meta_msg_);
}

void MetaAggregatorNode::write(const pmeta::RoundBook::Round& round) {
  keeper_.offer(round, driver_->aggregator().metaPolicy());
  log_->write(round);
}

void MetaAggregatorNode::saveCheckpoint(int round) {
  log_->sync();
  checkpoints_.save(round, *driver_);
}

}  // namespace pmeta_nodes
