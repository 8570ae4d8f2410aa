#pragma once

#include <memory>
#include <string>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {

/// A trained policy from a file, ready to act; the file is all it needs.
class LoadedPolicy {
 public:
  /// Reads the file and rebuilds its experiment. `as_task` is for a meta-policy whose networks are
  /// told the task by a one-hot input: which training task it shall act on. Throws Error if the
  /// file is none of a policy, its parameters do not fit its own settings, or it must be told a
  /// task.
  explicit LoadedPolicy(const std::string& path, int as_task = -1);
  LoadedPolicy(const LoadedPolicy&) = delete;
  LoadedPolicy& operator=(const LoadedPolicy&) = delete;

  /// By the settings that the file holds.
  const Experiment& experiment() const { return experiment_; }
  /// Of its task, or of task 0 for a meta-policy.
  const EnvSpec& spec() const { return env_->spec(); }
  const Model& model() const { return model_; }  ///< parameters as in the file
  PolicyKind policy() const { return policy_; }  ///< which of the two it is
  int task() const { return task_; }    ///< whose personal policy it is; -1 for a meta-policy
  int round() const { return round_; }  ///< rounds of training behind it
  /// For people, e.g. "personal policy of grid_4x4, round 10 of run RUN".
  std::string description() const;

  /// The greedy action (spec().action_size numbers) of an observation (spec().observation_size
  /// numbers); the lowest of equally good discrete ones. A policy with an inference network acts on
  /// the latent vector that its file holds: a meta-policy's is that before any exploration. False,
  /// and no action, if the observation is not finite or, for a table, of no state that the policy
  /// has values of. Allocates nothing.
  bool act(const double* observation, double* action);

  /// One greedy episode on its task, or of a meta-policy on task 0, with the start of the first
  /// evaluation episode of the run's rounds.
  Episode record();

 private:
  LoadedPolicy(const std::string& path, PolicyFile file, int as_task);
  std::vector<float> taskInput(const PolicyFile& file, const std::string& path, int as_task) const;

  Experiment experiment_;
  Model model_;
  PolicyKind policy_ = PolicyKind::kMeta;
  int task_ = -1;
  int round_ = 0;
  std::unique_ptr<Env> env_;  ///< of its task, or of task 0 for a meta-policy
  std::unique_ptr<PolicyFamily> policies_;
  std::unique_ptr<Actor> actor_;
  std::vector<std::size_t> envs_ = {0};  ///< as the actor is to be asked
  std::vector<float> observation_;
  Rng greedy_{0, 0, Stream::kEvaluate};  ///< which draws nothing
};

}  // namespace pmeta
