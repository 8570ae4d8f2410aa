#pragma once

#include <cstdint>
#include <string>

#include "pmeta_core/experiment/experiment.h"

namespace pmeta {

/// What does not change of a run's manifest.json, as JSON, with a place for what does: what the run
/// is (its defining settings and their hash, the tasks, code and machine) and, as "figures", what
/// whoever draws it must know of its algorithm and learner:
///   label            the algorithm's name for people
///   order            its place among others, which also decides its colour
///   baseline         is it one that others are compared with?
///   reference_line   is its meta-policy drawn as a line beside the curves of others?
///   compared_by      personal or meta: the policy that it is judged by
///   own_settings     that baselines have no use for
///   fixed_settings   that it fixes or has no use for: they tell no two runs of it apart
///   policies         table, q_network, actor_critic or other: what the policy files hold
///   curves           policy, split and context_episodes of each curve in rounds.csv
std::string constantManifest(const Experiment& experiment, const std::string& started);

/// A text of the run folder's manifest.json; "" if there is none.
std::string manifestText(const std::string& run_dir, const char* key);
/// The same of a whole number; 0 if there is none.
std::int64_t manifestCount(const std::string& run_dir, const char* key);

/// What differs between the machine that the run folder's manifest names and this one, as one
/// sentence, where it changes the numbers of this experiment; "" if nothing does.
std::string otherMachine(const Experiment& experiment);

}  // namespace pmeta
