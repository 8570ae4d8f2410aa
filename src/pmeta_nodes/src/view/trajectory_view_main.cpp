#include <ros/callback_queue.h>

#include "common/run_node.h"
#include "view/trajectory_view.h"

namespace {

constexpr char kHelp[] =
    R"(trajectory_view: shows the agents' last evaluation episodes as rviz markers.

  rosrun pmeta_nodes trajectory_view __ns:=/pmeta

private parameters
  ~redraw_rate  at most so many pictures a second of what stands still, up to 60 (default 10)
  ~frame_rate   pictures a second of episodes that are played, up to 60 (default 20)
  ~speed        episodes are played so many times as fast as in real time, up to 100 (default 1)
  ~config_file  settings file; by default the parameter `config` of the namespace is read
subscribes   task_<i>/trajectory, round, returns
publishes    markers, playback (both latched), static TF frames task_<i>/... below pmeta
Started by roslaunch pmeta_nodes gridworld.launch rviz:=true, and so for every experiment.
)";

int runView(const pmeta::Experiment& experiment) {
  ros::NodeHandle nh;
  pmeta_nodes::TrajectoryView view(nh, experiment);
  while (!pmeta_nodes::stopRequested()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "trajectory_view", kHelp, runView);
}
