// run_guard: the launch's required node. It ends when the run has ended, and so ends the launch;
// all other nodes may die and be started again.
#include <pmeta_msgs/RoundSummary.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "conversions.h"
#include "node_main.h"

namespace {

using pmeta_msgs::RoundSummary;

constexpr char kHelp[] =
    R"(run_guard: ends when the run has ended. As the launch's required node it ends the launch with it, while
the aggregator and the agents may die and be started again.

  rosrun pmeta_nodes run_guard __ns:=/pmeta

private parameters
  ~hold         stay until stopped (default false)
subscribes   round
Exit code 0 if the run has finished, 1 if it was stopped before its last round.
)";

// for the last messages to reach everybody first
constexpr double kFarewell = 0.5;

int guard(const pmeta::Experiment& experiment) {
  const bool hold = ros::NodeHandle("~").param("hold", false);
  const std::string run_id = experiment.settings().run_id;
  const pmeta::Authenticator authenticator(experiment.settings().key_file);
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
  return code == 1 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "run_guard", kHelp, guard);
}
