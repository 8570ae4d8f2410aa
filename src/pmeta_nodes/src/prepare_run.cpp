// prepare_run: what a launch file runs while it is read. Checks the settings before anything
// starts, writes the launch file that holds one agent for each task, and prints the effective
// settings, which become the parameter that all nodes read.
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/authentication.h"
#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/run_log.h"

namespace {

using pmeta::Error;
using pmeta::Experiment;

constexpr char kHelp[] =
    R"(prepare_run: checks a run's settings, writes the launch file of its agents, prints the settings.

  rosrun pmeta_nodes prepare_run CONFIG AGENTS_LAUNCH [--record] [key:=value ...]

CONFIG         settings file; with resume:=RUN_DIR the run there goes on, with its own settings
AGENTS_LAUNCH  launch file to write: a task_agent for each training and test task and, with --record, rosbag
key:=value     settings that override the file's; an empty value leaves the file's. The value of
               `settings` is itself a list of assignments: "settings:=slip=0.1 beta=0.5".
Called by the launch files; exits with 1 and one sentence if the settings are bad.
)";

std::string trim(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

// what the launch file passes: empty values mean "as in the file"
std::vector<std::string> readAssignments(const std::vector<std::string>& words) {
  std::vector<std::string> assignments;
  for (const std::string& word : words) {
    const auto split = word.find(":=");
    if (split == std::string::npos)
      throw Error("'" + word + "' is not an assignment: write key:=value.");
    const std::string value = trim(word.substr(split + 2));
    if (value.empty()) continue;
    if (word.substr(0, split) == "settings") {
      std::istringstream in(value);
      // a plain "=" here: roslaunch takes no second ":=" in an argument
      for (std::string one; in >> one;) {
        const auto equals = one.find('=');
        if (equals == std::string::npos || equals == 0 || one[equals - 1] == ':') {
          throw Error("'" + one + "' in settings is not of the form key=value.");
        }
        assignments.push_back(one.replace(equals, 1, ":="));
      }
    } else {
      assignments.push_back(word.substr(0, split) + ":=" + value);
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
  const std::string value = found->substr(key.size() + 2);
  assignments.erase(found);
  return value;
}

std::string escapeXml(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '$':
        out += "$$";  // roslaunch would substitute it
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string agentsLaunch(const Experiment& experiment, bool record) {
  std::ostringstream xml;
  xml << "<launch>\n";
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    xml << "  <node name=\"task_agent_" << task
        << "\" pkg=\"pmeta_nodes\" type=\"task_agent\" respawn=\"true\" respawn_delay=\"1\">\n"
        << "    <param name=\"task\" value=\"" << task << "\"/>\n"
        << "    <param name=\"resume\" value=\"true\"/>\n"
        << "  </node>\n";
  }
  if (record) {
    const std::string bag = experiment.runDir() + ".bag";
    xml << "  <node name=\"recorder\" pkg=\"rosbag\" type=\"record\" args=\"-O '" << escapeXml(bag)
        << "' -e '/pmeta/.*' -x /pmeta/playback\"/>\n";
  }
  xml << "</launch>\n";
  return xml.str();
}

// launch files of runs long over
void removeOldLaunchFiles(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const std::string prefix = "pmeta_agents";
  for (const auto& entry : fs::directory_iterator(file.parent_path(), error)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(prefix, 0) != 0 || entry.path().extension() != ".launch") continue;
    if (fs::file_time_type::clock::now() - fs::last_write_time(entry.path(), error) >
        std::chrono::hours(24)) {
      fs::remove(entry.path(), error);
    }
  }
}

int prepare(std::vector<std::string> words) {
  const auto flag = std::find(words.begin(), words.end(), "--record");
  const bool record = flag != words.end();
  if (record) words.erase(flag);
  words.erase(std::remove(words.begin(), words.end(), "--no-record"), words.end());
  if (words.size() < 2) throw Error("give CONFIG and AGENTS_LAUNCH; see prepare_run --help.");
  const std::string config = words[0];
  const std::filesystem::path launch_file = words[1];
  words.erase(words.begin(), words.begin() + 2);

  std::vector<std::string> assignments = readAssignments(words);
  const std::string resume = takeAssignment(assignments, "resume");
  const Experiment experiment = resume.empty() ? Experiment::load(config, assignments)
                                               : Experiment::resume(resume, assignments, config);
  const pmeta::Authenticator probe(experiment.settings().key_file);
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
  }
  for (const std::string& note : experiment.notes()) std::cerr << "pmeta: " << note << "\n";
  std::cerr << "settings\n" << experiment.table();

  std::error_code error;
  std::filesystem::create_directories(launch_file.parent_path(), error);
  removeOldLaunchFiles(launch_file);
  pmeta::writeFileAtomically(launch_file.string(), agentsLaunch(experiment, record));
  std::cout << experiment.yaml();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || words.front() == "--help" || words.front() == "-h") {
    std::cout << kHelp;
    return words.empty() ? 2 : 0;
  }
  try {
    return prepare(words);
  } catch (const std::exception& error) {
    std::cerr << "pmeta: " << error.what() << std::endl;
    return 1;
  }
}
