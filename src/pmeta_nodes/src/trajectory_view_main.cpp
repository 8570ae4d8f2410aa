#include <ros/callback_queue.h>

#include "node_main.h"
#include "trajectory_view.h"

namespace {

constexpr char kHelp[] =
    R"(trajectory_view: shows the agents' last evaluation episodes as rviz markers.

  rosrun pmeta_nodes trajectory_view __ns:=/pmeta

private parameters
  ~redraw_rate  at most so many pictures a second, up to 60 (default 10)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
subscribes   task_<i>/trajectory, round, returns
publishes    markers (latched), static TF frames task_<i>/personal and task_<i>/meta below pmeta
Started by roslaunch pmeta_nodes gridworld.launch rviz:=true.
)";

int runView(const pmeta::Experiment& experiment) {
  ros::NodeHandle nh;
  pmeta_nodes::TrajectoryView view(nh, ros::NodeHandle("~"), experiment);
  while (!pmeta_nodes::stopRequested()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "trajectory_view", kHelp, runView);
}
