#include "common/master_watch.h"

#include <ros/ros.h>

#include <algorithm>

#include "pmeta_core/nn/held_signals.h"

namespace pmeta_nodes {
namespace {

constexpr std::chrono::seconds kEvery{2};

enum class Master { kKnowsUs, kHasForgottenUs, kGone };

bool knowsUs() {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = ros::this_node::getName();
  return ros::master::execute("lookupNode", request, response, payload, false);
}

Master askMaster() {
  if (knowsUs()) return Master::kKnowsUs;
  if (!ros::master::check()) return Master::kGone;
  // the network may just have come back
  return knowsUs() ? Master::kKnowsUs : Master::kHasForgottenUs;
}

}  // namespace

MasterWatch::MasterWatch(std::chrono::duration<double> patience)
    : patience_(patience), thread_([this] { watch(); }) {}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  stopping_.notify_all();
  thread_.join();
}

std::string MasterWatch::trouble() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return trouble_;
}

bool MasterWatch::waitFor(std::chrono::duration<double> time) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !stopping_.wait_for(lock, time, [this] { return stop_; });
}

void MasterWatch::watch() {
  using Clock = std::chrono::steady_clock;
  // one that ended a call would look as if the master knew nothing; other threads heed them
  const pmeta::HeldSignals held_signals;
  Clock::time_point good = Clock::now();
  while (waitFor(kEvery)) {
    const Master master = askMaster();
    if (master == Master::kKnowsUs) {
      good = Clock::now();
      continue;
    }
    if (master == Master::kGone && Clock::now() - good < patience_) continue;
    const std::string uri = ros::master::getURI();
    const std::lock_guard<std::mutex> lock(mutex_);
    trouble_ = master == Master::kGone
                   ? "the ROS master at " + uri + " has been out of reach for " +
                         std::to_string(static_cast<int>(patience_.count())) + " s"
                   : "the ROS master at " + uri + " was restarted and does not know this node";
    return;
  }
}

}  // namespace pmeta_nodes
