#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/adapt/adaptation.h"
#include "pmeta_core/baselines/rl2_networks.h"
#include "pmeta_core/nn/aligned.h"

namespace pmeta {

/// What a policy of RL² remembers of a trial so far.
struct TrialMemory {
  /// Of a trial that is about to begin.
  explicit TrialMemory(const Rl2Networks& networks);

  AlignedFloats hidden;  ///< state of the recurrent network
  AlignedFloats last;    ///< a, r, d of the next step's input
  bool begun = false;    ///< has there been a step?
};

/// Acts by a policy of RL² in environments 0 to max_batch - 1. A step that breaks its episode down
/// leaves no trace in its memory.
class Rl2Actor : public Actor {
 public:
  /// The mean of its distribution, which draws nothing, or a sample.
  enum class By { kMean, kSample };

  /// All episodes in one environment are one trial. The networks must outlive the actor, as
  /// `parameters` must.
  Rl2Actor(const Rl2Networks& networks, const float* parameters, std::size_t max_batch, By by);

  /// Acts by the mean, and each episode goes on from a copy of `start`.
  Rl2Actor(const Rl2Networks& networks, const float* parameters, std::size_t max_batch,
           TrialMemory start);

  /// A trial begins in every environment.
  void forget();

  /// Of the trial in environment `env` so far.
  const TrialMemory& memory(std::size_t env) const { return memories_[env]; }

  void begin(std::size_t env, Rng& rng) override;
  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;
  void observe(const Experience& experience) override;

 private:
  const Rl2Networks& networks_;
  const float* parameters_;
  By by_;
  std::optional<TrialMemory> start_;
  std::vector<TrialMemory> memories_;
  // of the step at hand, by row
  std::vector<std::size_t> row_of_env_;
  AlignedFloats input_, hidden_;
  GruWorkspace recurrent_;
  MlpWorkspace head_;
  const float* means_ = nullptr;
};

/// Adapts as RL² does: the hidden state goes on from one exploration episode to the next. Acts by
/// the mean throughout.
class Rl2Adaptation : public Adaptation {
 public:
  /// `parameters` stay as they are; they and the networks must outlive this.
  Rl2Adaptation(const Rl2Networks& networks, const float* parameters);

  /// Of the exploration so far.
  const TrialMemory& memory() const { return acting_.memory(0); }

  void beginEpisode(Rng&) override {}
  void episodeOver() override {}
  bool remembers() const override { return true; }
  void begin(std::size_t env, Rng& rng) override { acting_.begin(env, rng); }
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    acting_.look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return acting_.act(row, rng, action);
  }
  void observe(const Experience& experience) override { acting_.observe(experience); }
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override;

 private:
  const Rl2Networks& networks_;
  const float* parameters_;
  Rl2Actor acting_;
};

}  // namespace pmeta
