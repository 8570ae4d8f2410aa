#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta {

/// Acts for several environments at once: reads `batch` observations (batch x observation_size),
/// writes as many actions (batch x action_size).
using BatchPolicy = std::function<void(const float* observations, int batch, double* actions)>;

/// Environments of one task that serve evaluation only: one for each episode.
class Evaluation {
 public:
  explicit Evaluation(std::vector<std::unique_ptr<Env>> envs);

  /// Undiscounted returns of one episode in each environment. They run in step, so that the policy
  /// sees them as one batch; all starts are drawn before the first step and thus depend on `rng`
  /// only. An episode that breaks down counts with its return until then.
  ReturnStats run(const BatchPolicy& policy, Rng& rng);

  /// One episode, from the start that the first episode of run() has at the same `rng`. Where it
  /// breaks down it is truncated, without the step that broke it.
  Episode record(const BatchPolicy& policy, Rng& rng);

 private:
  bool reset(std::size_t i, Rng& rng);
  std::optional<Step> step(std::size_t i, const double* action, Rng& rng);

  std::vector<std::unique_ptr<Env>> envs_;
  std::size_t observation_size_;
  std::size_t action_size_;
  std::vector<std::size_t> running_;  // environments whose episode goes on
  std::vector<double> returns_;
  std::vector<double> observation_;  // as an environment writes it
  std::vector<float> observations_;  // of the running ones, packed
  std::vector<double> actions_;
};

}  // namespace pmeta
