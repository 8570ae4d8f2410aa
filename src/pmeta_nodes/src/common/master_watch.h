#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace pmeta_nodes {

/// Watches over the ROS master from a thread of its own, since asking it may block while the
/// network is down.
///
/// Connections between nodes outlive the master, but a restarted master knows no node of before: no
/// late joiner finds them, and whoever is respawned stays alone. So a node whose master has been
/// gone for a while, or has forgotten it, had better stop and be started again.
class MasterWatch {
 public:
  /// `patience`: how long the master may be out of reach.
  explicit MasterWatch(std::chrono::duration<double> patience);
  ~MasterWatch();

  /// Why the node should stop, in a sentence; "" while all is well.
  std::string trouble() const;

 private:
  void watch();
  bool waitFor(std::chrono::duration<double> time);

  const std::chrono::duration<double> patience_;
  mutable std::mutex mutex_;
  std::condition_variable stopping_;
  bool stop_ = false;
  std::string trouble_;
  std::thread thread_;
};

}  // namespace pmeta_nodes
