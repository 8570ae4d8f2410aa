#include "common/run_node.h"

#include <ros/callback_queue.h>
#include <ros/master.h>

#include <csignal>
#include <cstring>
#include <iostream>
#include <memory>

#include "common/free_memory.h"
#include "common/master_watch.h"
#include "common/private_param.h"
#include "launch/addresses.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/nn/held_signals.h"

namespace pmeta_nodes {
namespace {

std::unique_ptr<MasterWatch> g_master;

// how long the master may be out of reach; a network may be down for a while and come back
constexpr std::chrono::seconds kMasterHere{10};
constexpr std::chrono::seconds kMasterElsewhere{120};
constexpr double kAskAgain = 0.2;      // seconds between two attempts at the master
constexpr double kLookForStop = 0.05;  // seconds

bool answersHelp(int argc, char** argv, const std::string& help) {
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--help") != 0 && std::strcmp(argv[i], "-h") != 0) continue;
    std::cout << help;
    return true;
  }
  return false;
}

// the exit code; an exception becomes one sentence
int orSentence(const std::function<int()>& body) {
  int code = 1;
  try {
    code = body();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
  }
  ros::shutdown();
  return code;
}

}  // namespace

void initNode(int argc, char** argv, const std::string& name, std::uint32_t options) {
  ros::init(argc, argv, name, options);
  // a script's background process has it ignored
  std::signal(SIGINT, SIG_DFL);
  if (ros::master::check()) return;
  ROS_WARN("waiting for the ROS master at %s; start one with roscore.",
           ros::master::getURI().c_str());
  while (!ros::master::check()) ros::WallDuration(kAskAgain).sleep();
}

int runPlainNode(int argc, char** argv, const std::string& name, const std::string& help,
                 const std::function<int()>& body) {
  pmeta::prepareProcess();
  if (answersHelp(argc, argv, help)) return 0;
  initNode(argc, argv, name);
  std::signal(SIGTERM, [](int) { ros::requestShutdown(); });
  // outside the try: the console falls silent when the last node handle goes
  const ros::NodeHandle nh;
  return orSentence(body);
}

int runNode(int argc, char** argv, const std::string& name, const std::string& help,
            const std::function<int(const pmeta::Experiment&)>& body) {
  pmeta::prepareProcess();
  if (answersHelp(argc, argv, help)) return 0;
  boundFreeMemory();
  initNode(argc, argv, name, ros::init_options::NoSigintHandler);
  const ros::NodeHandle nh;
  // our own handlers: the last words of a run are published before ROS goes down
  pmeta::heedStopSignals();
  return orSentence([&] {
    const pmeta::Experiment experiment = readExperiment(nh);
    const bool here = isHere(ros::master::getHost());
    g_master = std::make_unique<MasterWatch>(here ? kMasterHere : kMasterElsewhere);
    int code = body(experiment);
    const std::string trouble = g_master->trouble();
    if (!trouble.empty()) {
      ROS_FATAL("%s: this node has stopped. Start the run again with resume:=%s.", trouble.c_str(),
                experiment.runDir().c_str());
      code = 1;
    }
    g_master.reset();
    return code;
  });
}

bool stopRequested() {
  return pmeta::stopSignalled() || !ros::ok() || (g_master && !g_master->trouble().empty());
}

void spinUntilStopped() {
  while (!stopRequested()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kLookForStop));
  }
}

pmeta::Experiment readExperiment(const ros::NodeHandle& nh) {
  const std::string file = privateText("config_file", "");
  // on a machine of its own
  std::vector<std::string> places;
  for (const std::string key : {"results_dir", "key_file"}) {
    const std::string place = privateText(key, "");
    if (!place.empty()) places.push_back(key + ":=" + place);
  }
  if (!file.empty()) return pmeta::Experiment::load(file, places);
  std::string text;
  const pmeta::HeldSignals held_signals;  // see privateText()
  if (!nh.getParam("config", text)) {
    throw pmeta::Error("the parameter " + nh.resolveName("config") +
                       " is not set: start with roslaunch pmeta_nodes gridworld.launch, or give "
                       "_config_file:=FILE.");
  }
  return pmeta::Experiment::parse(text, "the parameter " + nh.resolveName("config"), places);
}

}  // namespace pmeta_nodes
