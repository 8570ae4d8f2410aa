#include "remote/call_watch.h"

#include "common/run_node.h"

namespace pmeta_nodes {
namespace {

constexpr auto kLook = std::chrono::milliseconds(20);

}  // namespace

CallWatch::CallWatch() : watcher_([this] { watch(); }) {}

CallWatch::~CallWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    closed_ = true;
  }
  closing_.notify_all();
  watcher_.join();
}

void CallWatch::begin(ros::ServiceClient& client, double seconds) {
  const std::lock_guard<std::mutex> lock(mutex_);
  client_ = &client;
  due_ = Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

void CallWatch::end() {
  const std::lock_guard<std::mutex> lock(mutex_);
  client_ = nullptr;
}

void CallWatch::watch() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!closing_.wait_for(lock, kLook, [this] { return closed_; })) {
    if (client_ == nullptr || (Clock::now() < due_ && !stopRequested())) continue;
    // the call finds its connection gone
    client_->shutdown();
    client_ = nullptr;
  }
}

}  // namespace pmeta_nodes
