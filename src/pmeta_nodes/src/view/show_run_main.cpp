#include <ros/callback_queue.h>

#include "common/private_param.h"
#include "common/run_node.h"
#include "pmeta_core/base/error.h"
#include "view/show_run.h"

namespace {

constexpr char kHelp[] =
    R"(show_run: shows what the policies of a finished run do, without training.

  roslaunch pmeta_nodes show.launch run:=RUN_FOLDER

private parameters
  ~run          folder with config.yaml and policies/ (required)
  ~best         the best policies that the run had, not the last (false)
  ~config_file  the folder's config.yaml
publishes    task_<i>/trajectory, returns, round, as agents and aggregator do; whoever comes late
             gets all of it
)";

bool goOn() {
  ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0));
  return !pmeta_nodes::stopRequested();
}

int show(const pmeta::Experiment&) {
  const std::string folder = pmeta_nodes::privateText("run", "");
  if (folder.empty()) throw pmeta::Error("which run? Give the private parameter run, a folder.");
  const bool best = pmeta_nodes::privateFlag("best", false);
  const pmeta::FinishedRun run(folder, best ? pmeta::Kept::kBest : pmeta::Kept::kLast);
  pmeta_nodes::ShowRun node(ros::NodeHandle(), run);
  node.evaluate(goOn);
  ROS_INFO("showing the policies of %s, round %d; Ctrl-C ends it",
           run.experiment().settings().run_id.c_str(), run.round());
  pmeta_nodes::spinUntilStopped();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return pmeta_nodes::runNode(argc, argv, "show_run", kHelp, show);
}
