#include "agent/party_node.h"

#include <ros/callback_queue.h>

#include <algorithm>
#include <utility>

#include "common/conversions.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/run/divergence.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;

// after the aggregator has left: time for roslaunch to stop us before we leave by ourselves, since
// it would respawn an agent that ends first
constexpr auto kFarewell = std::chrono::seconds(10);
constexpr double kAggregatorWait = 5.0;
// one would do, but a forged one behind it must not push it out
constexpr std::uint32_t kMetaPolicies = 8;

}  // namespace

PartyNode::PartyNode(const pmeta::Experiment& experiment, MakeParty make, const std::string& name,
                     bool resume)
    : experiment_(experiment),
      settings_hash_(experiment.settingsHash()),
      resume_(resume),
      make_(std::move(make)),
      name_(name),
      party_(make_()),
      checkpoints_(experiment, party_->number(), party_->layout()),
      tasks_(party_->tasks()),
      authenticator_(experiment.settings().key_file) {
  status_.run_id = experiment.settings().run_id;
  status_.updates_per_round = static_cast<std::uint32_t>(party_->workPerRound());

  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  const auto tasks = static_cast<std::uint32_t>(tasks_.size());
  auxiliary_pub_ = nh_.advertise<pmeta_msgs::AuxiliaryUpdate>("auxiliary", 4);
  // latching would keep only the last one for late viewers: they get both policies', of two rounds
  returns_pub_ = nh_.advertise<pmeta_msgs::TaskReturn>(
      "returns", 16 * tasks, [this](const ros::SingleSubscriberPublisher& viewer) {
        const std::lock_guard<std::mutex> lock(mutex_);
        for (const auto& recent : recent_returns_) {
          for (const auto& result : recent.second.all()) viewer.publish(*result);
        }
      });
  status_pub_ = nh_.advertise<AgentStatus>("agent_status", 4 * tasks, true);
  if (experiment.settings().publish_trajectories) {
    for (const int task : tasks_) advertiseEpisodes(task);
  }
  setState(AgentStatus::WAITING, "waiting for a meta-policy");
  meta_sub_ = nh_.subscribe("meta_policy", kMetaPolicies, &PartyNode::onMetaPolicy, this, hints);
  round_sub_ = nh_.subscribe("round", 4, &PartyNode::onRound, this, hints);
  status_timer_ = nh_.createWallTimer(ros::WallDuration(0.5),
                                      [this](const ros::WallTimerEvent&) { publishStatus(); });
  resend_timer_ =
      nh_.createWallTimer(ros::WallDuration(0.5), [this](const ros::WallTimerEvent&) { resend(); });
  health_ =
      std::make_unique<Health>(name_, experiment.hasMetaLearner() ? "meta-learner" : "task agent",
                               [this] { return health(); });
  trainer_ = std::thread([this] { train(); });
}

PartyNode::~PartyNode() {
  stop_ = true;
  mailbox_.close();
  if (trainer_.joinable()) trainer_.join();
}

int PartyNode::spin() {
  Clock::time_point alone_since = Clock::now();
  while (!stopRequested() && !failed_) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    if (!run_ended_ || meta_sub_.getNumPublishers() > 0) alone_since = Clock::now();
    if (Clock::now() - alone_since > kFarewell) break;
  }
  stop_ = true;
  mailbox_.close();
  trainer_.join();
  return failed_ || gave_up_ ? 1 : 0;
}

bool PartyNode::isAuthentic(const std::string& kind, pmeta::Authenticity authenticity) {
  const std::string forgery = refusals_.judge(kind, authenticity);
  if (forgery.empty()) return true;
  if (!refusals_.mayTell()) return false;
  ROS_WARN("ignored: %s%s", forgery.c_str(), refusals_.untold().c_str());
  bool alone = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    alone = newest_round_ < 0;
  }
  if (alone) setState(AgentStatus::WAITING, "waiting for a meta-policy; ignored: " + forgery);
  return false;
}

void PartyNode::onMetaPolicy(const pmeta_msgs::MetaPolicy::Ptr& msg) {
  if (!isAuthentic("a meta-policy", authenticate(authenticator_, *msg))) return;
  if (msg->run_id != status_.run_id) {
    ROS_WARN_THROTTLE(10, "ignoring a meta-policy of run %s; this agent belongs to %s.",
                      pmeta::shown(msg->run_id).c_str(), pmeta::shown(status_.run_id).c_str());
    return;
  }
  if (msg->settings_hash != settings_hash_) {
    const std::string mismatch =
        pmeta::otherSettings("the aggregator", msg->settings_hash, settings_hash_);
    ROS_ERROR_THROTTLE(10, "ignored: %s", mismatch.c_str());
    return setState(AgentStatus::WAITING, mismatch);
  }
  {
    // a newer meta-policy shows that the aggregator has all we owed it for the rounds before
    const std::lock_guard<std::mutex> lock(mutex_);
    const int round = static_cast<int>(msg->round);
    const bool started_again = msg->incarnation > incarnation_;
    if (msg->incarnation < incarnation_ || (!started_again && round <= newest_round_)) return;
    newest_round_ = round;
    incarnation_ = msg->incarnation;
    // what an aggregator that was started again lacks is made anew from its meta-policy
    const auto confirmed = [&](const auto& sent) {
      return started_again || static_cast<int>(sent.round) <= round;
    };
    unconfirmed_updates_.erase(
        std::remove_if(unconfirmed_updates_.begin(), unconfirmed_updates_.end(), confirmed),
        unconfirmed_updates_.end());
    unconfirmed_returns_.erase(
        std::remove_if(unconfirmed_returns_.begin(), unconfirmed_returns_.end(), confirmed),
        unconfirmed_returns_.end());
  }
  mailbox_.push(msg);
}

void PartyNode::onRound(const pmeta_msgs::RoundSummary::ConstPtr& msg) {
  if (!isAuthentic("a round message", authenticate(authenticator_, *msg))) return;
  if (msg->run_id != status_.run_id) return;
  if (authenticator_.hasKey() && !news_.take(msg->header.stamp)) {
    return refusals_.count("replayed: a round message");
  }
  if (msg->state != pmeta_msgs::RoundSummary::FINISHED &&
      msg->state != pmeta_msgs::RoundSummary::STOPPED) {
    return;
  }
  run_ended_ = true;
  const std::lock_guard<std::mutex> lock(mutex_);
  unconfirmed_returns_.clear();
  unconfirmed_updates_.clear();
}

void PartyNode::train() {
  try {
    while (!stop_ && !gave_up_) {
      const auto msg = mailbox_.pop(std::chrono::seconds(1));
      if (!msg) continue;
      try {
        trainFrom(fromMsg(std::move(**msg)));
      } catch (const pmeta::TaskFailed& failure) {
        giveUp(failure.what());
      } catch (const pmeta::LostEnvironment& lost) {
        giveUp(lost.what());
      } catch (const pmeta::Error& error) {
        // a meta-policy that does not fit is not trained on; a good one may still come
        ROS_ERROR("%s", error.what());
        setState(AgentStatus::WAITING, error.what());
      }
    }
  } catch (const pmeta::Interrupted&) {
    // whoever spins stops this
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    // nothing that is known to come again: roslaunch starts this process anew
    setState(AgentStatus::WAITING, error.what());
    failed_ = true;
  }
}

void PartyNode::giveUp(const std::string& failure) {
  ROS_ERROR("%s", failure.c_str());
  gave_up_ = true;
  setState(AgentStatus::FAILED, failure);
}

void PartyNode::evaluate(const pmeta::MetaPolicy& meta) {
  if (meta.round == 0 || !experiment_.evaluatesMeta() ||
      !(meta.evaluate || experiment_.evaluationSchedule().includes(meta.round))) {
    return;
  }
  setState(AgentStatus::EVALUATING,
           "evaluating the meta-policy of round " + std::to_string(meta.round));
  for (const pmeta::TaskReturn& result : party_->evaluateMeta(meta)) deliver(result);
  for (const auto& [task, publisher] : trajectory_pubs_) {
    showEpisode([&, of = task] { return party_->recordMeta(meta, of); }, task, meta.round,
                pmeta::PolicyKind::kMeta);
  }
}

void PartyNode::trainFrom(const pmeta::MetaPolicy& meta) {
  const int rounds = experiment_.settings().rounds;
  waitForAggregator();
  // first: what an evaluation tells may depend on what was trained
  if (party_->trains()) returnTo(meta);
  evaluate(meta);
  if (meta.round >= rounds) {
    setState(AgentStatus::DONE, "all " + std::to_string(rounds) + " rounds are done");
    return;
  }
  if (!party_->trains()) {
    setState(AgentStatus::WAITING,
             "test task: waiting for the meta-policy of round " + std::to_string(meta.round + 1));
    return;
  }

  const int round = meta.round + 1;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.round = static_cast<std::uint32_t>(round);
    status_.update = 0;
  }
  setState(AgentStatus::TRAINING, "training round " + std::to_string(round));
  const Clock::time_point start = Clock::now();
  if (!round_end_) round_end_ = start;
  auto result = party_->trainRound(meta, [this](std::int64_t done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.update = static_cast<std::uint32_t>(done);
    return !stop_;
  });
  if (!result) return;
  const Clock::time_point end = Clock::now();
  const Clock::time_point before = *std::exchange(round_end_, end);
  const double seconds = std::chrono::duration<double>(end - before).count();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.env_steps_per_s = static_cast<double>(result->env_steps) / seconds;
    status_.updates_per_s = static_cast<double>(result->updates) / seconds;
    status_.loss = result->loss;
    status_.loss_names.clear();
    status_.losses.clear();
    for (const pmeta::Loss& loss : result->losses) {
      status_.loss_names.push_back(loss.name);
      status_.losses.push_back(loss.value);
    }
    status_.broken_episodes = static_cast<std::uint64_t>(party_->brokenEpisodes());
    status_.distance_to_meta = result->distance;
    status_.train_s = std::chrono::duration<double>(end - start).count();
  }
  if (experiment_.checkpointsAfter(round) || meta.checkpoint) saveCheckpoint(round);
  // before the aggregator can end the run, and with it this process
  savePersonal(round);
  if (result->personal) deliver(*result->personal);
  deliver(std::move(result->update));
  if (!trajectory_pubs_.empty() && result->personal) {
    showEpisode([this] { return party_->recordPersonal(); }, party_->number(), round,
                pmeta::PolicyKind::kPersonal);
  }
  setState(AgentStatus::WAITING, "waiting for the meta-policy of round " + std::to_string(round));
}

// whoever has just been started, or has run ahead of the meta-policy, goes where that is
void PartyNode::returnTo(const pmeta::MetaPolicy& meta) {
  const int have = party_->round();
  const bool ahead = have > meta.round + 1;
  // at round 0 too: it may have ended between saving and sending round 1
  const bool started = have == 0 && resume_;
  if (!ahead && !started) return;
  std::vector<std::string> refused;
  const auto fresh = [this]() -> pmeta::Party& {
    party_.reset();  // two might not fit into the memory
    party_ = make_();
    return *party_;
  };
  const int round = checkpoints_.loadNewest(meta.round + 1, fresh, refused);
  for (const std::string& sentence : refused) ROS_WARN("%s", sentence.c_str());
  saved_round_ = round;
  if (round > 0) {
    ROS_INFO("%s goes on after round %d.", name_.c_str(), round);
    if (!experiment_.family().make(tasks_.front())->spec().restorable) {
      ROS_WARN("%s begins a new episode: the one it was in cannot be restored.", name_.c_str());
    }
  }
  if (round < meta.round) {
    ROS_WARN("%s has lost what it learnt in the rounds %d to %d: no good checkpoint is newer.",
             name_.c_str(), round + 1, meta.round);
  }
}

void PartyNode::saveCheckpoint(int round) {
  if (round == saved_round_) return;
  std::string trouble;
  try {
    checkpoints_.save(round, *party_);
    saved_round_ = round;
  } catch (const pmeta::Error& error) {
    // training goes on: what is at stake is only how much a crash would cost
    trouble = error.what();
    ROS_ERROR("%s The run goes on without this checkpoint.", error.what());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  checkpoint_trouble_ = trouble;
}

void PartyNode::savePersonal(int round) {
  try {
    party_->keepBest(experiment_);
    if (round == experiment_.settings().rounds) party_->savePersonal(experiment_, round);
  } catch (const pmeta::Error& error) {
    // the others can do without this machine's file
    ROS_ERROR("the personal policy is not kept: %s", error.what());
  }
}

void PartyNode::waitForAggregator() {
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(kAggregatorWait);
  while (!stop_ && ros::WallTime::now() < limit &&
         (auxiliary_pub_.getNumSubscribers() == 0 || returns_pub_.getNumSubscribers() == 0)) {
    ros::WallDuration(0.005).sleep();
  }
}

}  // namespace pmeta_nodes
