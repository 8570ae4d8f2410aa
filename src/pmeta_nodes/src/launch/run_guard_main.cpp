// run_guard: the launch's required node. When the run has ended it ends the launch; all other nodes
// may die and be started again.
#include <pmeta_msgs/RoundSummary.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

#include "common/conversions.h"
#include "common/news_order.h"
#include "common/private_param.h"
#include "common/run_node.h"
#include "launch/launch_parent.h"

namespace {

using pmeta_msgs::RoundSummary;

constexpr char kHelp[] =
    R"(run_guard: ends the launch when the run has ended, by the signal that Ctrl-C would send. The aggregator
and the agents may die and be started again.

  rosrun pmeta_nodes run_guard __ns:=/pmeta

private parameters
  ~hold         stay until stopped (default false)
  ~read_launch  launch file to delete, since it has been read; none by default
subscribes   round
Exit code 0 if the run has finished, 1 if it was stopped before its last round.
)";

// for the last messages to reach everybody first
constexpr double kFarewell = 0.5;
// for roslaunch to stop its nodes, this one among them
constexpr double kLaunchEnd = 60;

// A required node that ends by itself looks like an accident in roslaunch's output.
void endLaunch() {
  if (pmeta_nodes::launchCommand().empty()) return;
  kill(getppid(), SIGINT);
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(kLaunchEnd);
  while (!pmeta_nodes::stopRequested() && ros::WallTime::now() < limit) {
    ros::WallDuration(0.05).sleep();
  }
}

int guard(const pmeta::Experiment& experiment) {
  const bool hold = pmeta_nodes::privateFlag("hold", false);
  const std::string read = pmeta_nodes::privateText("read_launch", "");
  if (!read.empty()) std::remove(read.c_str());
  const std::string run_id = experiment.settings().run_id;
  const pmeta::Authenticator authenticator(experiment.settings().key_file);
  // signed news of before may have been recorded and be sent again, with its end of the run
  pmeta_nodes::NewsOrder order(ros::Time::now());
  int code = -1;
  ros::NodeHandle nh;
  const ros::Subscriber rounds = nh.subscribe<RoundSummary>(
      "round", 8,
      boost::function<void(const RoundSummary::ConstPtr&)>([&](const RoundSummary::ConstPtr& msg) {
        if (msg->run_id != run_id) return;
        if (pmeta_nodes::authenticate(authenticator, *msg) != pmeta::Authenticity::kAuthentic) {
          ROS_WARN_THROTTLE(10, "ignoring news of the run that is not authentic.");
          return;
        }
        if (authenticator.hasKey() && !order.take(msg->header.stamp)) return;
        if (msg->state == RoundSummary::FINISHED) code = 0;
        if (msg->state == RoundSummary::STOPPED) code = 1;
      }));
  bool told = false;
  while (!pmeta_nodes::stopRequested()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    if (code < 0) continue;
    // a run that was stopped has nothing to show
    if (!hold || code != 0) break;
    if (!told) ROS_INFO("the run is over; holding the scene and topics until Ctrl-C.");
    told = true;
  }
  ros::WallDuration(kFarewell).sleep();
  if (!pmeta_nodes::stopRequested()) endLaunch();
  return code == 1 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "run_guard", kHelp, guard);
}
