#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// Settings of the inference network and its context. Defaults are PEARL's (Rakelly et al., 2019).
struct ContextSettings {
  std::vector<int> hidden = {200, 200, 200};  ///< units of each hidden layer of the encoder
  int latent_size = 5;                        ///< length of z
  int batch_size = 100;    ///< transitions of one context, from which one z is inferred
  int buffer_size = 1000;  ///< recent context transitions kept
  /// In training a context's rows come from so many transitions in a row, as they do at test time,
  /// where all of them may be of one wrong guess; 0: from all that are kept, the sure among them.
  int window = 0;
  bool portable = false;  ///< see MlpSpec; set by the experiment's `arithmetic`
  int per_update = 1;   ///< contexts of one update, each giving its z to an equal part of the batch
  bool symlog = false;  ///< context rows hold sign(x) ln(1 + |x|) (Hafner et al., 2023) for each x
  double kl_weight = 0.1;         ///< weight of KL(q(z|c) || N(0, I))
  bool next_observation = false;  ///< part of a context row; for tasks that differ in dynamics
  /// While training, every how-many-th episode acts on z from the prior. These, and the random
  /// steps of the warm-up, are the context: it then looks as at test time. 1: every episode.
  int prior_interval = 2;
  /// The other episodes, which act on z from q(z|c), are context as well (PEARL's, where the reward
  /// is sparse): else hardly any context would show a reward.
  bool posterior_episodes = false;
  /// Whose actor acts on z from the prior: "meta" (the meta-policy's of the round, which also
  /// explores at test time) or "personal".
  std::string explorer = "meta";
  /// The meta-policy is evaluated before it has explored the task, and after so many episodes of
  /// exploration; ascending.
  std::vector<int> exploration_episodes = {2};
  bool exploration_noise = false;  ///< these act by samples instead of tanh(mean)
};

/// Binds all of them below `prefix`, e.g. "sac.".
void bind(Settings& settings, const std::string& prefix, ContextSettings& context);

/// q(z|c), a diagonal Gaussian; [latent_size] each.
struct LatentPosterior {
  std::vector<double> mean;      ///< 0 each for the prior
  std::vector<double> variance;  ///< 1 each for the prior
};

/// Sum over dimensions of KL(q || N(0, I)) = (variance + mean^2 - 1 - log variance) / 2.
double klToPrior(const LatentPosterior& posterior);

/// Draws z = mean + sqrt(variance) * noise with standard normal `noise`; [latent_size] each.
void drawLatent(const LatentPosterior& posterior, Rng& rng, double* noise, float* z);

/// q(z|c) of a set of transitions: a network maps each context row (s, a, r[, s']) to the mean mu_i
/// and variance s_i^2 = max(softplus(.), 1e-7) of a Gaussian factor, and their product, in which
/// the rows' order does not matter, is the posterior (PEARL; the prior is no factor):
///
///     variance = 1 / sum_i 1 / s_i^2,   mean = variance * sum_i mu_i / s_i^2
///
/// An empty context gives the prior, N(0, I). Parameters belong to the caller: blocks "encoder.*".
class ContextEncoder {
 public:
  /// Room for one pass over up to `max_rows` rows.
  struct Workspace {
    /// For up to `max_rows` (at least 1) rows of that encoder, which must outlive it.
    Workspace(const ContextEncoder& encoder, std::size_t max_rows);

    MlpWorkspace mlp;  ///< activations of the last pass
    /// Of the last pass, [rows, 2 * latent_size]: means, then variances before softplus.
    AlignedFloats heads;
    AlignedFloats d_heads;          ///< gradient by the heads, [rows, 2 * latent_size]
    std::vector<double> precision;  ///< sum_i 1 / s_i^2, [latent_size]
    std::vector<double> weighted;   ///< sum_i mu_i / s_i^2, [latent_size]
  };

  /// Both sizes as EnvSpec has them. Throws Error where Mlp does.
  ContextEncoder(int observation_size, int action_size, const ContextSettings& settings);

  const Mlp& network() const { return network_; }  ///< rowSize() inputs, 2 * latentSize() outputs
  std::size_t latentSize() const { return latent_size_; }    ///< numbers of z
  std::size_t rowSize() const { return network_.inputs(); }  ///< numbers of a context row

  /// Writes a context row of rowSize() floats.
  void writeRow(const Transition& transition, float* row) const;

  /// q(z|c) of `rows` context rows [rows, rowSize()]; more rows than the workspace holds are taken
  /// in pieces. Allocates nothing where `posterior` has its size already.
  void infer(const float* parameters, const float* context, std::size_t rows, Workspace& workspace,
             LatentPosterior& posterior) const;

  /// Gradient by the parameters, into `gradient` (network().size(), overwritten), of
  /// L(z) + kl_weight * KL, where z = mean + sqrt(variance) * noise and `d_z` is the gradient of L.
  /// All else as in the last infer(), whose rows the workspace must hold at once.
  void backward(const float* parameters, const float* context, std::size_t rows,
                const LatentPosterior& posterior, const double* noise, const float* d_z,
                double kl_weight, Workspace& workspace, float* gradient) const;

 private:
  int observation_size_;
  int action_size_;
  bool next_observation_;
  bool symlog_;
  std::size_t latent_size_;
  Mlp network_;
};

}  // namespace pmeta
