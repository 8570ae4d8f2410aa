#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"

namespace pmeta_nodes {

/// What a launch starts besides the settings.
struct Launch {
  std::string ns;       ///< of the run, e.g. "/pmeta"
  bool agents = true;   ///< does it start them?
  bool view = false;    ///< does it start trajectory_view?
  bool record = false;  ///< does it record a bag?
};

/// A node that trains.
struct PartyNode {
  std::string name;                         ///< within the run's namespace
  std::string type;                         ///< its program
  int task = -1;                            ///< that it is to be told; -1: none
  const pmeta::Machine* machine = nullptr;  ///< of the experiment, on which it runs; null: here
};

/// One for each task, or one of an algorithm that learns all of them in one process.
std::vector<PartyNode> partyNodes(const pmeta::Experiment& experiment);

/// The launch file of what depends on the settings: the nodes that train, on their machines, which
/// are looked at first; the recorder; and the settings as parameters. `file`: where it will be.
std::string agentsLaunch(const pmeta::Experiment& experiment, const Launch& launch,
                         const std::filesystem::path& file);

}  // namespace pmeta_nodes
