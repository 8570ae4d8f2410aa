#pragma once

#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/ModelBlob.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/Scores.h>
#include <pmeta_msgs/TaskReturn.h>
#include <pmeta_msgs/Trajectory.h>

#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/security/authentication.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta_nodes {

// The one place where messages and the core's types meet, as pairs. What comes in is checked here
// for form (hash, sizes, checksum, enumerations) and throws pmeta::Error with one sentence if it is
// bad; whether it belongs to the run is the core's to judge. What holds a model is taken by value:
// whoever has no more use for it moves it in, and its megabytes are not copied.

pmeta_msgs::ModelBlob toMsg(pmeta::Model model);  ///< with its layout, hash and checksum
pmeta::Model fromMsg(pmeta_msgs::ModelBlob msg);  ///< throws unless sizes, hash and checksum agree

/// `rounds`: of the whole run. The MAC is left empty, as in all of these.
pmeta_msgs::MetaPolicy toMsg(const pmeta::MetaPolicy& meta, int rounds);
/// Throws as for its model, or on a number that no run has.
pmeta::MetaPolicy fromMsg(pmeta_msgs::MetaPolicy msg);

pmeta_msgs::AuxiliaryUpdate toMsg(pmeta::AuxiliaryUpdate update);  ///< the stamp is the caller's
/// Throws as for its model, or on a number that no run has.
pmeta::AuxiliaryUpdate fromMsg(pmeta_msgs::AuxiliaryUpdate msg);

/// `task_name`: as the family has it.
pmeta_msgs::TaskReturn toMsg(const pmeta::TaskReturn& result, const std::string& task_name);
/// Throws on a policy, split or number that no run has.
pmeta::TaskReturn fromMsg(const pmeta_msgs::TaskReturn& msg);

/// An episode of that policy on `task`, as recorded after `round`.
pmeta_msgs::Trajectory toMsg(const pmeta::Episode& episode, const pmeta::Experiment& experiment,
                             int task, int round, pmeta::PolicyKind policy);

/// Fills the fields a finished round gives; state and message are the caller's.
pmeta_msgs::RoundSummary toMsg(const pmeta::RoundSummary& summary,
                               const pmeta::Experiment& experiment);
/// Throws on a number that no run has.
pmeta::RoundSummary fromMsg(const pmeta_msgs::RoundSummary& msg);

/// The returns of an evaluated round, by task.
pmeta_msgs::Scores toScores(const pmeta::RoundBook::Round& round,
                            const pmeta::Experiment& experiment);

/// A message's state as a word: "waiting", "running", ...; "unknown" if it is none of the type's.
std::string stateName(const pmeta_msgs::AgentStatus& msg);
std::string stateName(const pmeta_msgs::RoundSummary& msg);  ///< the same of the run

// The MAC that a message's contents ask for, read from the message as it is. They throw
// pmeta::Error if a field is of no run.
/// Of the fields of AgentNews.
pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::AgentStatus& msg);
/// Over the model as it arrived.
pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::AuxiliaryUpdate& msg);
/// Over the model as it arrived.
pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::MetaPolicy& msg);
/// Of all fields but the words for reading along.
pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::TaskReturn& msg);
/// Of all fields but the words for reading along.
pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::RoundSummary& msg);

/// Fills in the MAC, once all other fields are; without a key the message stays as it is.
template <class Msg>
void sign(const pmeta::Authenticator& authenticator, Msg& msg) {
  if (authenticator.hasKey()) msg.mac = macOf(authenticator, msg);
}

/// Whether a message is from somebody with the key. Unpacks no model.
template <class Msg>
pmeta::Authenticity authenticate(const pmeta::Authenticator& authenticator, const Msg& msg) {
  if (!authenticator.hasKey()) return pmeta::Authenticity::kAuthentic;
  if (msg.mac.empty()) return pmeta::Authenticity::kUnsigned;
  try {
    return pmeta::Authenticator::compare(msg.mac, macOf(authenticator, msg));
  } catch (const pmeta::Error&) {
    return pmeta::Authenticity::kForged;  // nobody signs what cannot be
  }
}

}  // namespace pmeta_nodes
