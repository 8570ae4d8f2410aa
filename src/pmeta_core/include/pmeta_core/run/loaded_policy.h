#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/act/episode.h"
#include "pmeta_core/adapt/adaptation.h"
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
  /// What it is told of its task, unless it explores: see PolicyFamily::taskInputSize().
  const std::vector<float>& taskInput() const { return task_input_; }
  PolicyKind policy() const { return policy_; }  ///< which of the two it is
  int task() const { return task_; }    ///< whose personal policy it is; -1 for a meta-policy
  int round() const { return round_; }  ///< rounds of training behind it
  /// For people, e.g. "personal policy of grid_4x4, round 10 of run RUN".
  std::string description() const;

  /// The greedy action (spec().action_size numbers) of an observation (spec().observation_size
  /// numbers); the lowest of equally good discrete ones. A policy with an inference network acts on
  /// the latent vector that its file holds: a meta-policy's is that before any exploration, unless
  /// it explores. False, and no action, if the observation is not finite or, for a table, of no
  /// state that the policy has values of. Allocates nothing, but where it explores.
  bool act(const double* observation, double* action);

  /// From now on a meta-policy that is not told its task finds it out: it explores for
  /// explorationEpisodes() episodes, then acts greedily by what it has come to know. Its draws
  /// depend on `seed` alone. False, and no change, for any other policy.
  bool explore(std::uint64_t seed);

  int explorationEpisodes() const { return exploration_episodes_; }  ///< 0 without explore()
  int episode() const { return episode_; }  ///< since explore(), from 1; 0 before the first
  bool exploring() const { return adaptation_ && !adapted_; }  ///< finding out the task
  /// Must it be told what comes of each action?
  bool observes() const { return exploring() || (adaptation_ && adaptation_->remembers()); }

  /// Since explore(): an episode begins; the one before is over, if there was one.
  void beginEpisode();
  /// What came of the last action: the reward that policies are judged by, and the observation
  /// that it led to. False, and nothing is kept, if a number is not finite.
  bool observe(double reward, const double* next_observation);

  /// See Adaptation::taskWeights(); nothing without explore().
  std::vector<double> taskWeights() const {
    return adaptation_ ? adaptation_->taskWeights() : std::vector<double>();
  }

  /// One greedy episode on its task, or of a meta-policy on task 0, with the start of the first
  /// evaluation episode of the run's rounds.
  Episode record();

 private:
  LoadedPolicy(const std::string& path, PolicyFile file, int as_task);
  bool take(const double* numbers, std::vector<float>& observation) const;
  Actor& acting();
  std::vector<float> readTaskInput(const PolicyFile& file, const std::string& path,
                                   int as_task) const;

  Experiment experiment_;
  bool told_ = false;  ///< which task to act on
  Model model_;
  std::vector<float> task_input_;
  PolicyKind policy_ = PolicyKind::kMeta;
  int task_ = -1;
  int round_ = 0;
  std::unique_ptr<Env> env_;  ///< of its task, or of task 0 for a meta-policy
  std::unique_ptr<PolicyFamily> policies_;
  std::unique_ptr<Actor> actor_;
  std::vector<std::size_t> envs_ = {0};  ///< as the actor is to be asked
  std::vector<float> observation_;
  std::vector<float> next_observation_;
  std::vector<double> action_;  ///< the last one
  Rng rng_{0, 0, Stream::kEvaluate};
  // since explore()
  std::unique_ptr<Adaptation> adaptation_;
  std::unique_ptr<Actor> adapted_;  ///< once it knows its task
  int exploration_episodes_ = 0;
  int episode_ = 0;
};

}  // namespace pmeta
