#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"

namespace pmeta {

/// A computer of its own for some of a run's agents, on which roslaunch starts them over ssh. It
/// decides where something is learnt, and not what.
struct Machine {
  std::string name;         ///< that the settings give it
  std::string host;         ///< its address or name, by which all others reach it
  std::string user;         ///< who logs in there; "" as ssh has it
  int ssh_port = 22;        ///< that its ssh server listens on
  double timeout = 10;      ///< seconds that roslaunch's own process there may take to start
  std::string env_loader;   ///< path there of what sets up ROS and pMeta, then does as it is told
  std::string results_dir;  ///< path there of what its agents keep; "" means that of the run
  std::string key_file;     ///< path there of the key; "" means that of the run
  std::vector<int> tasks;   ///< whose agents run there
};

/// One for each name below `machines` in what settings files and overrides say.
std::vector<Machine> outlineMachines(const ListedSettings& given);

/// Binds their settings, "machines.NAME.host" and so on; the list must not grow afterwards.
void bindMachines(Settings& settings, std::vector<Machine>& machines);

/// Throws Error unless each can be reached by what is said of it and has tasks, 0 to `tasks` - 1,
/// that no other has.
void checkMachines(const std::vector<Machine>& machines, int tasks);

/// The one among them on which a task's agent runs; null if it runs where the run is launched.
const Machine* machineOf(const std::vector<Machine>& machines, int task);

}  // namespace pmeta
