#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "pmeta_core/baselines/metacure_settings.h"
#include "pmeta_core/baselines/trial_store.h"
#include "pmeta_core/env/env_spec.h"
#include "pmeta_core/nn/gru.h"
#include "pmeta_core/nn/mlp.h"

namespace pmeta {

/// A recurrent encoder of trials: after each token (s_t, a_{t-1}, r_{t-1}), zeros before the first
/// action, a linear layer on its hidden state gives the belief b_t = (mean, variance) of a diagonal
/// Gaussian over z, variance = max(softplus(.), 1e-4). From one episode to the next a and r are
/// kept; r is the reward that policies are judged by. Flat parameters: "encoder.*",
/// "encoder_head.*".
class BeliefEncoder {
 public:
  /// Room for one step of one trial.
  struct Workspace {
    /// For this encoder.
    explicit Workspace(const BeliefEncoder& encoder)
        : recurrent(encoder.gru_, 1, 1), head(encoder.head_, 1) {}
    GruWorkspace recurrent;  ///< of the recurrent unit
    MlpWorkspace head;       ///< of the linear layer
  };

  /// Throws Error unless sizes are positive.
  BeliefEncoder(const EnvSpec& env, const MetaCureSettings& settings);

  /// Numbers of an observation.
  std::size_t observationSize() const { return observation_size_; }
  /// Numbers of an action.
  std::size_t actionSize() const { return gru_.inputs() - observation_size_ - 1; }
  std::size_t tokenSize() const { return gru_.inputs(); }         ///< of a token
  std::size_t latentSize() const { return head_.outputs() / 2; }  ///< of z
  std::size_t beliefSize() const { return head_.outputs(); }      ///< mean and variance
  std::size_t units() const { return gru_.units(); }              ///< of the hidden state

  std::size_t size() const { return gru_.size() + head_.size(); }  ///< parameters
  std::vector<Block> blocks() const;                               ///< of them, in order
  /// Orthogonal weights, biases 0.
  void initialise(float* parameters, Rng& rng) const;

  /// Takes in one token: `hidden` moves on, and gives `belief`.
  void step(const float* parameters, const float* token, float* hidden, float* belief,
            Workspace& workspace) const;

 private:
  friend class TrialBeliefs;

  void toBeliefs(const float* outputs, std::size_t rows, float* beliefs) const;

  std::size_t observation_size_;
  Gru gru_;
  Mlp head_;
};

/// Sum over dimensions of KL(belief || N(0, I)).
template <class Scalar>
double beliefKl(const Scalar* belief, std::size_t latent_size) {
  double kl = 0;
  for (std::size_t i = 0; i < latent_size; ++i) {
    const double mean = belief[i], variance = belief[latent_size + i];
    kl += 0.5 * (variance + mean * mean - 1 - std::log(variance));
  }
  return kl;
}

/// Adds to `d_belief` the gradient of L(z) + kl_weight * KL(belief || N(0, I)), where
/// z = mean + sqrt(variance) * noise and `d_z` is the gradient of L.
void addBeliefGradient(const float* belief, std::size_t latent_size, const float* noise,
                       const float* d_z, float kl_weight, float* d_belief);

/// Beliefs along whole trials, forward and back through time: b_0 to b_T of one of T steps.
class TrialBeliefs {
 public:
  /// Of up to `max_trials` trials of up to `max_steps` steps each. The encoder must outlive it.
  TrialBeliefs(const BeliefEncoder& encoder, std::size_t max_trials, std::size_t max_steps);

  /// Of `trials`, at least one, which must stay where they are until backward().
  void infer(const float* parameters, const std::vector<StoredTrial>& trials);

  /// b_t of the k-th trial.
  const float* at(std::size_t k, std::size_t t) const { return &beliefs_[place(k, t)]; }

  /// Where the gradient by it is to be added; 0 after infer().
  float* gradientAt(std::size_t k, std::size_t t) { return &d_beliefs_[place(k, t)]; }

  /// Gradient by the encoder's parameters, into `gradient`. Once after an infer(), with its
  /// parameters.
  void backward(const float* parameters, float* gradient);

 private:
  std::size_t place(std::size_t k, std::size_t t) const {
    return (first_rows_[t] + rank_[k]) * encoder_.beliefSize();
  }
  void writeTokens(const StoredTrial& trial, std::size_t k);

  const BeliefEncoder& encoder_;
  GruWorkspace recurrent_;
  MlpWorkspace head_;
  // the longest trial first: which they are, and the place of each among them
  std::vector<std::size_t> order_, rank_;
  std::vector<std::size_t> batches_, first_rows_;  // by token: how many trials have it, from where
  std::size_t rows_ = 0;
  const float* hidden_ = nullptr;
  // by row: tokens of one time together
  AlignedFloats tokens_, beliefs_, d_beliefs_, d_hidden_;
};

}  // namespace pmeta
