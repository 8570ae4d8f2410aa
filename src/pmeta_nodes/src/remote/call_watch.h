#pragma once

#include <ros/service_client.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace pmeta_nodes {

/// Ends calls of persistent services that last too long, or longer than the process is to live:
/// ROS's own wait for an answer for as long as the connection stands.
class CallWatch {
 public:
  CallWatch();
  ~CallWatch();

  /// client.call(service), which fails after `seconds` by closing the client's connection.
  template <class Service>
  bool call(ros::ServiceClient& client, Service& service, double seconds) {
    begin(client, seconds);
    const bool answered = client.call(service);
    end();
    return answered;
  }

 private:
  using Clock = std::chrono::steady_clock;

  void begin(ros::ServiceClient& client, double seconds);
  void end();
  void watch();

  std::mutex mutex_;
  std::condition_variable closing_;
  bool closed_ = false;
  ros::ServiceClient* client_ = nullptr;  ///< that is being called
  Clock::time_point due_{};
  std::thread watcher_;
};

}  // namespace pmeta_nodes
