#pragma once

#include <QObject>
#include <QString>
#include <QTimer>

#ifndef Q_MOC_RUN
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <array>
#include <atomic>
#include <mutex>
#include <thread>

#include "common/mailbox.h"
#include "panel/run_state.h"
#endif

namespace pmeta_nodes {

/// What a user can ask of a run, each by a service below pmeta in rviz's own namespace.
enum class Request {
  kPause,       ///< pause (std_srvs/SetBool) with true
  kResume,      ///< pause with false
  kEvaluate,    ///< evaluate (std_srvs/Trigger)
  kCheckpoint,  ///< save_checkpoint (std_srvs/Trigger)
};

/// The full name of the request's service.
std::string serviceOf(Request request);

/// Follows the run below pmeta, in rviz's own namespace, for a GUI that must never wait for ROS.
///
/// Subscriptions have a callback queue and a thread of their own; services are looked for and
/// called in another one. Methods and slots are for the GUI's thread; signals reach it through its
/// queue.
class RunMonitor : public QObject {
  Q_OBJECT

 public:
  explicit RunMonitor(QObject* parent);  ///< begins to follow; asks ROS for nothing else
  ~RunMonitor() override;

  /// What is known now. The next message emits changed() again.
  RunState takeState();

  /// Is the service there? As of two seconds ago or less.
  bool offers(Request request) const;

  /// Asks, and emits answered() once there is an answer or none has come within five seconds.
  /// One request at a time: does nothing while busy().
  void ask(Request request);
  bool busy() const { return busy_; }  ///< is a request on its way?

 Q_SIGNALS:
  /// Something new has come since takeState().
  void changed();
  /// A request has ended: did it succeed, and in words.
  void answered(bool success, const QString& text);

 private:
  static constexpr std::size_t kRequests = 4;

  void subscribe();
  void tell();
  void work();
  void lookForServices();
  void call(Request request);
  template <class Service>
  bool callService(const std::string& name, Service& service);
  void cancelCall();

  std::mutex mutex_;  ///< guards the state
  RunState state_;
  std::mutex client_mutex_;
  ros::ServiceClient client_;  ///< of the call that is on its way

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::Subscriber round_sub_;
  ros::Subscriber returns_sub_;
  ros::Subscriber status_sub_;
  ros::AsyncSpinner spinner_;

  std::atomic<bool> told_{false};  ///< changed() was emitted and the state not taken yet
  std::atomic<bool> stop_{false};
  std::array<std::atomic<bool>, kRequests> offered_{};
  bool busy_ = false;
  std::atomic<bool> timed_out_{false};
  QTimer timeout_;
  Mailbox<Request> requests_{kRequests};
  std::thread worker_;
};

}  // namespace pmeta_nodes
