#pragma once

#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/ModelBlob.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>

#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/protocol.h"

namespace pmeta_nodes {

// The one place where messages and the core's types meet, as pairs. What comes in is checked here
// for form (hash, sizes, checksum, enumerations) and throws pmeta::Error with one sentence if it is
// bad; whether it belongs to the run is the core's to judge.

pmeta_msgs::ModelBlob toMsg(const pmeta::Model& model);
pmeta::Model fromMsg(const pmeta_msgs::ModelBlob& msg);

pmeta_msgs::MetaPolicy toMsg(const pmeta::MetaPolicy& meta, int rounds);
pmeta::MetaPolicy fromMsg(const pmeta_msgs::MetaPolicy& msg);

pmeta_msgs::AuxiliaryUpdate toMsg(const pmeta::AuxiliaryUpdate& update);
pmeta::AuxiliaryUpdate fromMsg(const pmeta_msgs::AuxiliaryUpdate& msg);

pmeta_msgs::TaskReturn toMsg(const pmeta::TaskReturn& result, const std::string& task_name);
pmeta::TaskReturn fromMsg(const pmeta_msgs::TaskReturn& msg);

pmeta_msgs::Trajectory toMsg(const pmeta::Episode& episode, const pmeta::Experiment& experiment,
                             int task, int round, pmeta::Policy policy);

/// Fills the fields a finished round gives; state and message are the caller's.
pmeta_msgs::RoundSummary toMsg(const pmeta::RoundSummary& summary,
                               const pmeta::Experiment& experiment);

}  // namespace pmeta_nodes
