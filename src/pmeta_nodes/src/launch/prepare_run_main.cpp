// prepare_run: what a launch file runs while it is read. Checks the settings before anything
// starts, writes the launch file that holds one agent for each task, and prints the effective
// settings, which become the parameter that all nodes read.
#include <ros/names.h>
#include <ros/network.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "launch/addresses.h"
#include "launch/agents_launch.h"
#include "launch/launch_parent.h"
#include "launch/launch_words.h"
#include "launch/live_nodes.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/manifest.h"
#include "pmeta_core/storage/run_log.h"

namespace {

using pmeta::Error;
using pmeta::Experiment;
using pmeta_nodes::Launch;
using pmeta_nodes::PartyNode;

constexpr char kHelp[] =
    R"(prepare_run: checks a run's settings, writes the launch file of its agents, prints the settings.

  rosrun pmeta_nodes prepare_run CONFIG AGENTS_LAUNCH [key:=value ...]
  rosrun pmeta_nodes prepare_run --check LAUNCH_FILE CONFIG [key:=value ...]

CONFIG         settings file; with resume:=RUN_DIR the run there goes on, with its own settings
AGENTS_LAUNCH  launch file to write: a task_agent for each training and test task, or the
               meta_learner of algorithms that have one (unless agents:=false),
               with record:=true rosbag, the machines that the settings name, and the settings as the
               parameters below `settings`
LAUNCH_FILE    launch file of pMeta's: checks what it is to be called with, and prints the run's folder and
               how many agents it has
key:=value     settings that override the file's; an empty value leaves the file's. The value of
               `settings` is itself a list of assignments: "settings:=slip=0.1 sizes=[4, 5]".
ns:=NAME       the launch's nodes are below /NAME/pmeta; by default below /pmeta. ROS_NAMESPACE goes before
               either. With view:=true there is a trajectory_view among them
Launch files call it with --launch FOLDER LINES, where LINES has the words, a line each; then the
settings on roslaunch's own command line count too, declared or not.
Exits with 1 and one sentence if the settings are bad or, without --check, if nodes of the same names
live: the ROS master would end them, and theirs is a run that goes on.
)";

// what the launch file passes: empty values mean "as in the file"
std::vector<std::string> readAssignments(const std::vector<std::string>& words) {
  std::vector<std::string> assignments;
  for (const std::string& word : words) {
    const auto split = word.find(":=");
    if (split == std::string::npos)
      throw Error("'" + word + "' is not an assignment: write key:=value.");
    if (split + 2 == word.size()) continue;
    if (word.substr(0, split) == "settings") {
      for (std::string& one : pmeta_nodes::splitSettings(word.substr(split + 2))) {
        assignments.push_back(std::move(one));
      }
    } else {
      assignments.push_back(word);
    }
  }
  return assignments;
}

// the value of `key`, "" if there is none, taken out of the assignments
std::string takeAssignment(std::vector<std::string>& assignments, const std::string& key) {
  const auto found = std::find_if(
      assignments.begin(), assignments.end(),
      [&](const std::string& assignment) { return assignment.rfind(key + ":=", 0) == 0; });
  if (found == assignments.end()) return "";
  std::string value = found->substr(key.size() + 2);
  assignments.erase(found);
  return value;
}

// a launch argument that is "true" or "false", taken out of the assignments
bool takeFlag(std::vector<std::string>& assignments, const std::string& key, bool by_default) {
  const std::string value = takeAssignment(assignments, key);
  if (value.empty()) return by_default;
  for (const char* yes : {"true", "True", "1"}) {
    if (value == yes) return true;
  }
  for (const char* no : {"false", "False", "0"}) {
    if (value == no) return false;
  }
  throw Error(key + " is " + pmeta::shown(value) + " but must be true or false.");
}

Launch takeLaunch(std::vector<std::string>& assignments) {
  const std::string name = takeAssignment(assignments, "ns");
  const char* around = std::getenv("ROS_NAMESPACE");
  const std::string outer = around == nullptr ? "" : around;
  Launch launch;
  std::string problem;
  launch.ns = ros::names::clean(name.rfind('/', 0) == 0 ? name + "/pmeta"
                                                        : "/" + outer + "/" + name + "/pmeta");
  if (!ros::names::validate(launch.ns, problem)) {
    throw Error("ns is " + pmeta::shown(name) +
                " but must be a name of letters, digits, '_' and '/', beginning with a letter.");
  }
  launch.agents = takeFlag(assignments, "agents", true);
  launch.view = takeFlag(assignments, "view", false);
  launch.record = takeFlag(assignments, "record", false);
  for (const char* key : {"rviz", "hold"}) takeFlag(assignments, key, false);
  return launch;
}

// a master ends the node that has a name when another one takes it
void requireFreeNames(const Experiment& experiment, const Launch& launch) {
  std::vector<std::string> names = {"run_guard", "meta_aggregator"};
  if (launch.view) names.push_back("trajectory_view");
  if (launch.record) names.push_back("recorder");
  if (launch.agents) {
    for (const PartyNode& node : pmeta_nodes::partyNodes(experiment)) names.push_back(node.name);
  }
  for (std::string& name : names) name = launch.ns + "/" + name;
  const std::string master = pmeta_nodes::launchMaster();
  const std::vector<pmeta_nodes::LiveNode> live = pmeta_nodes::liveNodes(master, names);
  if (live.empty()) return;
  const std::string run = pmeta_nodes::runOf(master, launch.ns + "/config");
  throw Error(
      (run.empty() ? "a run" : "the run " + pmeta::shown(run)) + " is alive on the ROS master at " +
      master + ": " + pmeta_nodes::listNodes(live) +
      ". Stop it first (Ctrl-C in its terminal, or kill these processes), or start this one "
      "in a namespace (ns:=NAME) or on a master of its own "
      "(ROS_MASTER_URI=http://localhost:PORT).");
}

// what to do where nodes here give out an address that no other machine reaches; "" where they do
// not
std::string loopbackAdvice() {
  const std::string given = pmeta_nodes::givenOutAddress();
  if (!pmeta_nodes::isLoopback(given)) return "";
  std::string master;
  std::uint32_t port = 0;
  ros::network::splitURI(pmeta_nodes::launchMaster(), master, port);
  const std::vector<std::string> own = pmeta_nodes::ownAddresses();
  const std::string advice =
      "nodes here give out " + given + ", where no other machine reaches them: ";
  if (own.empty())
    return advice + "connect this machine to a network, then set ROS_IP to its address.";
  const std::string others = pmeta::join({own.begin() + 1, own.end()}, " or ");
  return advice + "type 'export ROS_IP=" + own.front() + "' and launch again" +
         (others.empty() ? "" : " (this machine is also " + others + ")") +
         "; agent.launch on another machine takes 'export ROS_MASTER_URI=http://" + own.front() +
         ":" + std::to_string(port) + "'.";
}

void requireReachable(const Experiment& experiment, const Launch& launch) {
  if (!launch.agents) return;
  for (const pmeta::Machine& machine : experiment.settings().machines) {
    const std::string advice = pmeta_nodes::isHere(machine.host) ? "" : loopbackAdvice();
    if (!advice.empty()) {
      throw Error("machines." + machine.name + " is another machine, but " + advice);
    }
  }
}

// launch files of launches that ended before their nodes were started; others are deleted by
// run_guard
void removeOldLaunchFiles(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const std::string prefix = "pmeta_agents";
  for (const auto& entry : fs::directory_iterator(file.parent_path(), error)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(prefix, 0) != 0 || entry.path().extension() != ".launch") continue;
    if (fs::file_time_type::clock::now() - fs::last_write_time(entry.path(), error) >
        std::chrono::hours(1)) {
      fs::remove(entry.path(), error);
    }
  }
}

// the run that the words ask for, if it can be started
Experiment checkedExperiment(const std::string& config, std::vector<std::string> assignments) {
  const std::string resume = takeAssignment(assignments, "resume");
  Experiment experiment = resume.empty() ? Experiment::load(config, assignments)
                                         : Experiment::resume(resume, assignments, config);
  const pmeta::Authenticator probe(experiment.settings().key_file);
  // what a package's environments cannot do is told here, and not by agents that start again and
  // again
  const bool foreign = !experiment.family().package().name.empty();
  for (int task = 0; foreign && task < experiment.totalTasks(); ++task) {
    experiment.family().make(task);
  }
  if (resume.empty()) {
    pmeta::requireWritable(experiment.settings().results_dir + "/" +
                           experiment.settings().experiment);
    if (!pmeta::runStatus(experiment.runDir()).empty()) {
      throw Error("the run folder " + experiment.runDir() +
                  " already holds a run: choose another run_id, or go on with it by resume:=" +
                  experiment.runDir() + ".");
    }
  } else {
    pmeta::requireResumable(experiment.runDir());
    const std::string other_machine = pmeta::otherMachine(experiment);
    if (!other_machine.empty()) std::cerr << "pmeta: warning: " << other_machine << "\n";
  }
  return experiment;
}

int check(const std::vector<std::string>& words) {
  if (words.size() < 2)
    throw Error("--check needs LAUNCH_FILE and CONFIG; see prepare_run --help.");
  std::vector<std::string> assignments = readAssignments(pmeta_nodes::handedOn(
      {words.begin() + 2, words.end()},
      pmeta_nodes::readLaunchFile(words[0], std::filesystem::path(words[0]).parent_path())));
  const Launch launch = takeLaunch(assignments);
  const Experiment experiment = checkedExperiment(words[1], assignments);
  requireReachable(experiment, launch);
  std::cout << experiment.runDir() << "\n" << pmeta_nodes::partyNodes(experiment).size() << "\n";
  return 0;
}

int prepare(std::vector<std::string> words) {
  if (words.size() < 2) throw Error("give CONFIG and AGENTS_LAUNCH; see prepare_run --help.");
  const std::string config = words[0];
  const std::filesystem::path launch_file = words[1];
  words.erase(words.begin(), words.begin() + 2);

  std::vector<std::string> assignments = readAssignments(words);
  const Launch launch = takeLaunch(assignments);
  const Experiment experiment = checkedExperiment(config, assignments);
  requireReachable(experiment, launch);
  requireFreeNames(experiment, launch);
  const std::string advice = launch.agents ? "" : loopbackAdvice();
  if (!advice.empty()) std::cerr << "pmeta: warning: agents:=false, but " << advice << "\n";
  for (const std::string& note : experiment.notes()) std::cerr << "pmeta: " << note << "\n";
  std::cerr << "settings\n" << experiment.table();

  std::error_code error;
  std::filesystem::create_directories(launch_file.parent_path(), error);
  removeOldLaunchFiles(launch_file);
  pmeta::writeFileAtomically(launch_file.string(),
                             pmeta_nodes::agentsLaunch(experiment, launch, launch_file));
  std::cout << experiment.yaml();
  return 0;
}

int answer(std::vector<std::string> words) {
  if (words.front() == "--check") return check({words.begin() + 1, words.end()});
  if (words.front() == "--launch") {
    if (words.size() != 3) throw Error("--launch needs FOLDER and LINES; see prepare_run --help.");
    words = pmeta_nodes::wordsOfLaunch(words[2], pmeta_nodes::launchCommand(), words[1]);
  }
  return prepare(std::move(words));
}

}  // namespace

int main(int argc, char** argv) {
  pmeta::prepareProcess();
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || words.front() == "--help" || words.front() == "-h") {
    std::cout << kHelp;
    return words.empty() ? 2 : 0;
  }
  try {
    return answer(words);
  } catch (const std::exception& error) {
    std::cerr << "pmeta: " << error.what() << std::endl;
    return 1;
  }
}
