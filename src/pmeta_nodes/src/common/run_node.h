#pragma once

#include <ros/ros.h>

#include <functional>
#include <string>

#include "pmeta_core/experiment/experiment.h"

namespace pmeta_nodes {

/// ros::init(), then waits until the master answers and says so. roscpp would wait for it for ever,
/// whatever signals come; here SIGINT and SIGTERM end the process at once until there is one.
void initNode(int argc, char** argv, const std::string& name, std::uint32_t options = 0);

/// What a node's main() does: answers --help, sets up ROS, calls `body`, and turns an exception
/// into one sentence and exit code 1. `body` returns the exit code and is expected to come back
/// soon once stopRequested(). SIGINT and SIGTERM shut ROS down, unless `body` heeds them itself.
int runPlainNode(int argc, char** argv, const std::string& name, const std::string& help,
                 const std::function<int()>& body);

/// The same of a node of a run: it reads the experiment first, heeds SIGINT and SIGTERM, and stops
/// when its master is gone.
int runNode(int argc, char** argv, const std::string& name, const std::string& help,
            const std::function<int(const pmeta::Experiment&)>& body);

/// SIGINT or SIGTERM came, ROS is shutting down, or its master is gone (see MasterWatch).
bool stopRequested();

/// Answers callbacks until stopRequested().
void spinUntilStopped();

/// The experiment from `~config_file`, if given, or else from the parameter `config`, which the
/// launch file sets to the effective settings. Throws pmeta::Error if there is none.
pmeta::Experiment readExperiment(const ros::NodeHandle& nh);

}  // namespace pmeta_nodes
