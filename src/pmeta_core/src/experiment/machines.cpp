#include "pmeta_core/experiment/machines.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/named_groups.h"

namespace pmeta {
namespace {

constexpr char kGroup[] = "machines";

// as hosts and users are named, and no more: they become words of commands
bool isPlainWord(const std::string& text) {
  return !text.empty() && text.front() != '-' &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-';
         });
}

// there is no folder on another machine that a path could be relative to
bool isPathThere(const std::string& path) {
  return isPlainText(path) && (path.rfind('/', 0) == 0 || path.rfind("~/", 0) == 0);
}

void checkMachine(const std::string& key, const Machine& machine) {
  const auto refuse = [&](const char* name, const std::string& value, const std::string& allowed) {
    throw Error(key + "." + name + " is " + shown(value) + " but must be " + allowed + ".");
  };
  if (!isPlainWord(machine.host)) {
    refuse("host", machine.host, "the address or name of the machine, e.g. 192.168.1.7");
  }
  if (!machine.user.empty() && !isPlainWord(machine.user)) {
    refuse("user", machine.user, "the name of a user there, or \"\" for the one that ssh takes");
  }
  if (!isPathThere(machine.env_loader)) {
    refuse(
        "env_loader", machine.env_loader,
        "the path there, from / or ~/ on, of the env.sh of its build, e.g. ~/pmeta/devel/env.sh");
  }
  for (const auto& [name, path] :
       {std::pair<const char*, const std::string&>("results_dir", machine.results_dir),
        {"key_file", machine.key_file}}) {
    if (!path.empty() && path.front() != '/') {
      refuse(name, path, "a path there, from / on, or \"\" for that of the run");
    }
  }
}

}  // namespace

std::vector<Machine> outlineMachines(const ListedSettings& given) {
  for (const auto& [key, value] : given) {
    if (key == kGroup) {
      throw Error(
          "machines must hold machines by name, each with its settings below it, e.g. "
          "machines: {robot_1: {host: 192.168.1.7, tasks: [0], env_loader: "
          "~/pmeta/devel/env.sh}}.");
    }
  }
  std::vector<Machine> machines;
  for (std::string& name : namesBelow(kGroup, given)) {
    machines.emplace_back();
    machines.back().name = std::move(name);
  }
  return machines;
}

void bindMachines(Settings& settings, std::vector<Machine>& machines) {
  for (Machine& machine : machines) {
    const std::string key = kGroup + ("." + machine.name) + ".";
    settings.bind(key + "host", machine.host,
                  "over ROS: address or name of a computer for the agents of some tasks");
    settings.bind(key + "tasks", machine.tasks,
                  "that are learnt there, from 0; all others where the run is launched",
                  Range::atLeast(0), Empty::kAllowed);
    settings.bind(key + "user", machine.user, "who logs in there; \"\" as ssh has it");
    settings.bind(key + "env_loader", machine.env_loader,
                  "path there of the env.sh of its build, which sets up ROS and pMeta");
    settings.bind(key + "results_dir", machine.results_dir,
                  "path there where its agents keep checkpoints and personal policies; \"\" means "
                  "results_dir");
    settings.bind(key + "key_file", machine.key_file, "path there; \"\" means key_file");
    settings.bind(key + "ssh_port", machine.ssh_port, "port of its ssh server",
                  Range::between(1, 65535));
    settings.bind(key + "timeout", machine.timeout,
                  "seconds that roslaunch may take to start there", Range::between(1, 3600));
  }
}

void checkMachines(const std::vector<Machine>& machines, int tasks) {
  std::map<int, std::string> machine_of;
  for (const Machine& machine : machines) {
    const std::string key = kGroup + ("." + machine.name);
    checkMachine(key, machine);
    if (machine.tasks.empty()) {
      throw Error(key + ".tasks is empty: write which tasks are learnt there, e.g. tasks: [0, 1].");
    }
    for (const int task : machine.tasks) {
      if (task >= tasks) {
        throw Error(key + ".tasks holds " + std::to_string(task) + " but the experiment has " +
                    std::to_string(tasks) + " tasks, from 0 to " + std::to_string(tasks - 1) + ".");
      }
      const auto [other, is_first] = machine_of.emplace(task, machine.name);
      if (is_first) continue;
      throw Error(other->second == machine.name
                      ? key + ".tasks holds " + std::to_string(task) + " twice: write it once."
                      : "task " + std::to_string(task) + " is both among machines." +
                            other->second + ".tasks and " + key + ".tasks: leave it with one.");
    }
  }
}

const Machine* machineOf(const std::vector<Machine>& machines, int task) {
  const auto found = std::find_if(machines.begin(), machines.end(), [&](const Machine& machine) {
    return std::find(machine.tasks.begin(), machine.tasks.end(), task) != machine.tasks.end();
  });
  return found == machines.end() ? nullptr : &*found;
}

}  // namespace pmeta
