#include "pmeta_core/env/remote_family.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <set>
#include <utility>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/named_groups.h"
#include "pmeta_core/env/task_split.h"

namespace pmeta {
namespace {

const RegisteredFamily<RemoteFamily> kFamily(kRemoteName);

const std::string kObservations = "environment.observations";
const std::string kActions = "environment.actions";

bool isNameOfRos(const std::string& text) {
  return text.front() == '/' && text.back() != '/' &&
         std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; });
}

template <class Entries>
std::vector<Quantity> quantities(const std::string& key, const Entries& entries) {
  if (entries.empty()) {
    throw Error(key + " has nothing below it: name every number, e.g. angle: {unit: rad}.");
  }
  std::vector<Quantity> all;
  for (const auto& entry : entries) {
    Quantity one{entry.name, entry.unit};
    if (!entry.limits.empty()) {
      if (entry.limits.size() != 2 || !(entry.limits[0] < entry.limits[1])) {
        throw Error(key + "." + entry.name + ".limits must be [low, high], or [] for none.");
      }
      one.low = entry.limits[0];
      one.high = entry.limits[1];
    }
    all.push_back(one);
  }
  return all;
}

}  // namespace

RemoteFamily::Connect& RemoteFamily::connector() {
  static Connect connect;
  return connect;
}

void RemoteFamily::outline(const ListedSettings& given) {
  for (auto& [key, entries] :
       {std::pair<const std::string&, Entries&>(kObservations, observations_),
        std::pair<const std::string&, Entries&>(kActions, actions_)}) {
    for (const std::string& name : namesBelow(key, given)) entries.push_back({name, "", {}});
  }
}

void RemoteFamily::bind(Settings& settings) {
  const std::string group = "environment.";
  settings.bind(group + "servers", servers_,
                "namespaces of the services of robots or simulators, one for each training task",
                {}, Empty::kAllowed);
  settings.bind(group + "test_servers", test_servers_, "the same for test tasks", {},
                Empty::kAllowed);
  settings.bind(group + "horizon", description_.horizon,
                "steps after which an episode is truncated", Range::between(1, 1e6));
  settings.bind(group + "step_seconds", description_.step_seconds,
                "how long a step takes; 0: there is no such time", Range::between(0, 3600));
  settings.bind(group + "pause", pace_.pause,
                "least seconds between the end of an episode and the next reset",
                Range::between(0, 86400));
  settings.bind(group + "rate", pace_.rate,
                "most steps in a second, of which late ones are counted; 0: as fast as they go",
                Range::between(0, 1e4));
  settings.bind(group + "timeout", patience_.timeout,
                "seconds for the answer to a step, then it is asked for again",
                Range::between(0.01, 3600));
  settings.bind(group + "reset_timeout", patience_.reset_timeout,
                "seconds for the answer to a reset, then it is asked for again",
                Range::between(0.01, 86400));
  settings.bind(group + "retries", patience_.retries,
                "how often a step is asked for again before its episode is given up",
                Range::between(0, 1000));
  settings.bind(group + "patience", patience_.patience,
                "seconds that a robot may be away before its task fails", Range::between(1, 1e7));
  for (Entry& entry : observations_) {
    const std::string key = kObservations + "." + entry.name + ".";
    settings.bind(key + "unit", entry.unit, "of this number of the observation; \"\": none");
    settings.bind(key + "limits", entry.limits, "[low, high] of it while an episode goes on", {},
                  Empty::kAllowed);
  }
  for (Entry& entry : actions_) {
    const std::string key = kActions + "." + entry.name + ".";
    settings.bind(key + "unit", entry.unit, "of this number of an action; \"\": none");
    settings.bind(key + "limits", entry.limits, "[low, high], to which [-1, 1] is scaled", {},
                  Empty::kAllowed);
  }
  settings.bind(group + "choices", description_.choices,
                "names of the discrete actions, of which the one number is the index; [] where "
                "actions are continuous",
                {}, Empty::kAllowed);
}

void RemoteFamily::build(std::uint64_t) {
  if (servers_.empty()) {
    throw Error("environment.servers must name a namespace for each task, e.g. [/robot_0].");
  }
  std::set<std::string> names;
  for (int task = 0; task < numTasks() + numTestTasks(); ++task) {
    const std::string& server = serverOf(task);
    if (!isNameOfRos(server)) {
      throw Error("environment.servers holds " + shown(server) +
                  " but must hold full names of ROS, e.g. /robot_0.");
    }
    if (!names.insert(taskName(task)).second) {
      throw Error("environment.servers names " + server +
                  " twice: a robot can have one task only.");
    }
  }
  if (description_.horizon == 0) throw Error("environment.horizon must say how long episodes are.");
  description_.observation = quantities(kObservations, observations_);
  if (!description_.choices.empty()) {
    if (actions_.size() != 1 || !actions_.front().limits.empty()) {
      throw Error(kActions + " must name one number, without limits, where there are choices.");
    }
    const double last = static_cast<double>(description_.choices.size()) - 1;
    description_.action = {{actions_.front().name, actions_.front().unit, 0, last}};
    return;
  }
  description_.action = quantities(kActions, actions_);
  for (const Entry& entry : actions_) {
    if (entry.limits.empty()) {
      throw Error(kActions + "." + entry.name +
                  ".limits must be [low, high] of what the robot takes.");
    }
  }
}

const std::string& RemoteFamily::serverOf(int task) const {
  return task < numTasks() ? servers_.at(static_cast<std::size_t>(task))
                           : test_servers_.at(static_cast<std::size_t>(task - numTasks()));
}

std::string RemoteFamily::taskName(int task) const {
  std::string name = serverOf(task).substr(1);
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

std::string RemoteFamily::taskDescription(int task) const {
  return "behind the services of " + serverOf(task);
}

std::unique_ptr<Env> RemoteFamily::create(int task) const {
  if (!connector()) {
    throw Error(
        "environment.name is remote, whose robots are reached over ROS: use ./pmeta run or "
        "roslaunch.");
  }
  const std::string& server = serverOf(task);
  return std::make_unique<RemoteEnv>(
      server, description_, pace_,
      [this, server] { return connector()(server, description_, patience_, figures_); }, figures_);
}

std::vector<std::pair<std::string, std::string>> RemoteFamily::figures() const {
  return {{"late steps", std::to_string(figures_.late_steps)},
          {"lost episodes", std::to_string(figures_.lost)},
          {"connections", std::to_string(figures_.connections)}};
}

}  // namespace pmeta
