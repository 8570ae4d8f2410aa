#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {

/// What a policy does on a task.
struct ShownPolicy {
  TaskReturn result;  ///< of one evaluation
  Episode episode;    ///< the first of those behind it
};

/// The policies that a run has left in its folder, evaluated without training, with the starts of
/// the rounds' evaluations.
class FinishedRun {
 public:
  /// `run_dir` holds config.yaml and policies/; `overrides` of its settings as Experiment::load()
  /// takes them. Throws Error if it is no such folder, or has no policies.
  FinishedRun(std::string run_dir, Kept kept, const std::vector<std::string>& overrides = {});

  const Experiment& experiment() const { return experiment_; }  ///< by the run's settings
  /// Of training behind its policies; the latest, where that differs.
  int round() const { return round_; }

  /// A training task's personal policy, with what its file knows of the task; nothing where there
  /// is none.
  std::optional<ShownPolicy> personal(int task) const;

  /// The meta-policy on every task, test tasks last, after the most exploration episodes that there
  /// are; none where there is no meta-policy.
  std::vector<ShownPolicy> meta() const;

 private:
  std::unique_ptr<LoadedPolicy> load(PolicyKind policy, int task) const;

  std::string run_dir_;
  Kept kept_;
  Experiment experiment_;
  int round_ = 0;
};

}  // namespace pmeta
