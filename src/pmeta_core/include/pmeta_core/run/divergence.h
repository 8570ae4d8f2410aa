#pragma once

#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {

/// A task's training or evaluation cannot go on, and would come to the same end if it were done
/// again: the sentence names the task, the round, and the settings to look at.
class TaskFailed : public Error {
 public:
  using Error::Error;
};

/// What shows that these parameters have diverged, as a clause: "entry 8 is nan"; "" if nothing
/// does. Their sums, with their weights, must not overflow either.
std::string divergence(const Model& model);

/// What to do where training diverges: a clause that names the settings, with their values.
std::string stepSizes(const Experiment& experiment);

/// What to do where the simulation breaks down.
std::string simulationSettings(const Experiment& experiment);

}  // namespace pmeta
