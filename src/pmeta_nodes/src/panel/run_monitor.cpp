#include "panel/run_monitor.h"

#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;
using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;

constexpr int kAnswerWithin = 5000;  // ms
constexpr std::chrono::duration<double> kLookEvery{2};
// of several agents each: one message must not push out another agent's
constexpr std::uint32_t kManyAgents = 256;

}  // namespace

std::string serviceOf(Request request) {
  switch (request) {
    case Request::kEvaluate:
      return ros::names::resolve("pmeta/evaluate");
    case Request::kCheckpoint:
      return ros::names::resolve("pmeta/save_checkpoint");
    default:
      return ros::names::resolve("pmeta/pause");
  }
}

RunMonitor::RunMonitor(QObject* parent) : QObject(parent), spinner_(1, &queue_) {
  timeout_.setSingleShot(true);
  connect(&timeout_, &QTimer::timeout, this, [this] {
    timed_out_ = true;
    cancelCall();
  });
  connect(this, &RunMonitor::answered, this, [this] {
    timeout_.stop();
    busy_ = false;
  });
  subscribe();
  spinner_.start();
  worker_ = std::thread([this] { work(); });
}

RunMonitor::~RunMonitor() {
  stop_ = true;
  requests_.close();
  cancelCall();
  worker_.join();
  spinner_.stop();
}

void RunMonitor::subscribe() {
  nh_.setCallbackQueue(&queue_);
  const boost::function<void(const RoundSummary::ConstPtr&)> on_round =
      [this](const RoundSummary::ConstPtr& message) {
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          state_.take(*message);
        }
        tell();
      };
  const boost::function<void(const TaskReturn::ConstPtr&)> on_return =
      [this](const TaskReturn::ConstPtr& message) {
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          state_.take(*message);
        }
        tell();
      };
  const boost::function<void(const AgentStatus::ConstPtr&)> on_status =
      [this](const AgentStatus::ConstPtr& message) {
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          state_.take(*message, std::chrono::steady_clock::now());
        }
        tell();
      };
  round_sub_ = nh_.subscribe<RoundSummary>("pmeta/round", 1, on_round);
  returns_sub_ = nh_.subscribe<TaskReturn>("pmeta/returns", kManyAgents, on_return);
  status_sub_ = nh_.subscribe<AgentStatus>("pmeta/agent_status", kManyAgents, on_status);
}

void RunMonitor::tell() {
  if (!told_.exchange(true)) Q_EMIT changed();
}

RunState RunMonitor::takeState() {
  told_ = false;
  const bool connected = round_sub_.getNumPublishers() > 0;
  const std::lock_guard<std::mutex> lock(mutex_);
  state_.connected = connected;
  return state_;
}

bool RunMonitor::offers(Request request) const {
  return offered_[static_cast<std::size_t>(request)];
}

void RunMonitor::ask(Request request) {
  if (busy_) return;
  busy_ = true;
  timed_out_ = false;
  timeout_.start(kAnswerWithin);
  requests_.push(request);
}

void RunMonitor::work() {
  lookForServices();
  while (!stop_) {
    if (const auto request = requests_.pop(kLookEvery)) call(*request);
    if (!stop_) lookForServices();
  }
}

void RunMonitor::lookForServices() {
  bool differs = false;
  for (std::size_t i = 0; i < kRequests && !stop_; ++i) {
    const bool there = ros::service::exists(serviceOf(static_cast<Request>(i)), false);
    differs = offered_[i].exchange(there) != there || differs;
  }
  if (differs) tell();
}

void RunMonitor::call(Request request) {
  const std::string name = serviceOf(request);
  bool called = false;
  bool success = false;
  std::string text;
  if (request == Request::kPause || request == Request::kResume) {
    std_srvs::SetBool service;
    service.request.data = static_cast<std::uint8_t>(request == Request::kPause);
    called = callService(name, service);
    success = service.response.success != 0;
    // what has gone well shows in the run's state
    if (!success) text = service.response.message;
  } else {
    std_srvs::Trigger service;
    called = callService(name, service);
    success = service.response.success != 0;
    text = service.response.message;
  }
  if (!called) {
    text = timed_out_ ? "no answer from " + name + " within 5 s" : "cannot call " + name;
  }
  Q_EMIT answered(called && success, QString::fromStdString(text));
}

template <class Service>
bool RunMonitor::callService(const std::string& name, Service& service) {
  // persistent: only such a connection can be dropped while a call waits. Made outside the lock,
  // since it asks the master
  ros::ServiceClient client = nh_.serviceClient<Service>(name, true);
  {
    const std::lock_guard<std::mutex> lock(client_mutex_);
    if (stop_ || timed_out_) return false;
    client_ = client;
  }
  const bool called = client.call(service);
  const std::lock_guard<std::mutex> lock(client_mutex_);
  client_ = ros::ServiceClient();
  return called;
}

void RunMonitor::cancelCall() {
  const std::lock_guard<std::mutex> lock(client_mutex_);
  client_.shutdown();
}

}  // namespace pmeta_nodes
