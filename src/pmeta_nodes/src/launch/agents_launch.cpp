#include "launch/agents_launch.h"

#include <regex>
#include <sstream>

#include "launch/addresses.h"
#include "pmeta_core/storage/origin.h"

namespace pmeta_nodes {
namespace {

using pmeta::Experiment;
using pmeta::Machine;

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
      default:
        out += c;
    }
  }
  return out;
}

// as one word of a command, which roslaunch and ssh split like a shell
std::string quoted(std::string text) {
  for (std::size_t at = 0; (at = text.find('\'', at)) != std::string::npos; at += 4) {
    text.replace(at, 1, "'\\''");
  }
  return "'" + text + "'";
}

// within quotes a shell would not know ~ for what it is
std::string quotedPath(const std::string& path) {
  return path.rfind("~/", 0) == 0 ? "~/" + quoted(path.substr(2)) : quoted(path);
}

// parameters hold no whole numbers of more than 32 bits: such a seed is given as text
std::string parameterYaml(const Experiment& experiment) {
  return std::regex_replace(experiment.yaml(), std::regex("(: )([0-9]{10,})(\n)"), "$1\"$2\"$3");
}

std::string textYaml(const std::string& line) {
  return "'" + std::regex_replace(line, std::regex("'"), "''") + "'";
}

// what roslaunch starts there first, so that its nodes give out the address that reaches them
std::string envLoader(const Machine& machine) {
  return "env " + addressSetting(machine.host) + " " + quotedPath(machine.env_loader);
}

void writeMachines(std::ostream& xml, const std::vector<Machine>& machines,
                   const std::filesystem::path& file) {
  if (machines.empty()) return;
  for (const Machine& machine : machines) {
    xml << "  <machine name=\"" << machine.name << "\" address=\"" << machine.host << "\"";
    if (!machine.user.empty()) xml << " user=\"" << machine.user << "\"";
    xml << " ssh-port=\"" << machine.ssh_port << "\" timeout=\"" << machine.timeout
        << "\" env-loader=\"" << escapeXml(envLoader(machine)) << "\"/>\n";
  }
  xml << "  <param name=\"machines\" command=\"$(find pmeta_nodes)/check_machines.py "
      << escapeXml(quoted(file.string())) << "\"/>\n";
}

void writeParam(std::ostream& xml, const char* name, const std::string& value) {
  if (value.empty()) return;
  xml << "    <param name=\"" << name << "\" type=\"str\" value=\"" << escapeXml(value) << "\"/>\n";
}

void writeNode(std::ostream& xml, const PartyNode& node) {
  xml << "  <node name=\"" << node.name << "\" pkg=\"pmeta_nodes\" type=\"" << node.type << "\"";
  if (node.machine != nullptr) xml << " machine=\"" << node.machine->name << "\"";
  xml << " respawn=\"true\" respawn_delay=\"1\">\n";
  if (node.task >= 0) xml << "    <param name=\"task\" value=\"" << node.task << "\"/>\n";
  xml << "    <param name=\"resume\" value=\"true\"/>\n";
  if (node.machine != nullptr) {
    writeParam(xml, "results_dir", node.machine->results_dir);
    writeParam(xml, "key_file", node.machine->key_file);
  }
  xml << "  </node>\n";
}

}  // namespace

std::vector<PartyNode> partyNodes(const Experiment& experiment) {
  if (experiment.hasMetaLearner()) return {{"meta_learner", "meta_learner"}};
  std::vector<PartyNode> nodes;
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    nodes.push_back({"task_agent_" + std::to_string(task), "task_agent", task,
                     pmeta::machineOf(experiment.settings().machines, task)});
  }
  return nodes;
}

std::string agentsLaunch(const Experiment& experiment, const Launch& launch,
                         const std::filesystem::path& file) {
  std::ostringstream xml;
  xml << "<launch>\n"
      << "  <rosparam ns=\"settings\" subst_value=\"false\">\n"
      << escapeXml(parameterYaml(experiment)) << "  </rosparam>\n"
      << "  <rosparam param=\"origin\" subst_value=\"false\">"
      << escapeXml(textYaml(pmeta::originOf(experiment))) << "</rosparam>\n";
  if (launch.agents) {
    writeMachines(xml, experiment.settings().machines, file);
    for (const PartyNode& node : partyNodes(experiment)) writeNode(xml, node);
  }
  if (launch.record) {
    const std::string bag = experiment.runDir() + ".bag";
    xml << "  <node name=\"recorder\" pkg=\"rosbag\" type=\"record\" args=\"-O "
        << escapeXml(quoted(bag)) << " -e '" << launch.ns << "/.*' -x " << launch.ns
        << "/playback\"/>\n";
  }
  xml << "</launch>\n";
  return xml.str();
}

}  // namespace pmeta_nodes
