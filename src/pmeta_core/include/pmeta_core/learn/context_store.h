#pragma once

#include <cstddef>
#include <vector>

#include "pmeta_core/learn/context_encoder.h"
#include "pmeta_core/replay/replay_buffer.h"

namespace pmeta {

/// A context and the z drawn from its posterior: a task as it was inferred once.
struct InferredTask {
  /// Room for one context of settings.batch_size rows.
  explicit InferredTask(const ContextEncoder& encoder, const ContextSettings& settings);

  AlignedFloats rows;                   ///< the context, [batch_size, rowSize()]
  ContextEncoder::Workspace workspace;  ///< as infer() left it, for backward()
  LatentPosterior posterior;            ///< q(z|c) of these rows
  std::vector<double> noise;            ///< that z was drawn with, [latent_size]
  std::vector<float> z;                 ///< mean + sqrt(variance) * noise, [latent_size]
  std::vector<float> d_z;               ///< gradient by z, for whoever trains the encoder
};

/// Transitions of one task from which its z is inferred: the most recent ones.
class ContextStore {
 public:
  /// The encoder must outlive the store.
  ContextStore(const ContextEncoder& encoder, const ContextSettings& settings, int observation_size,
               int action_size);

  /// Keeps it in the place of the oldest once settings.buffer_size are kept.
  void add(const Transition& transition) { kept_.add(transition); }
  const ReplayBuffer& kept() const { return kept_; }  ///< what contexts are drawn from

  /// Draws a context from what is kept, settings.window transitions in a row of it if that is not
  /// 0, and z by the encoder at `parameters`. Throws nothing, allocates nothing.
  void draw(const float* parameters, Rng& rng, InferredTask& task) const;

  /// q(z|c) by all that is kept.
  LatentPosterior posterior(const float* parameters) const;

  /// The transitions; settings and encoder are not part of it.
  void saveState(StateWriter& writer) const { kept_.saveState(writer); }
  /// Throws Error where ReplayBuffer does.
  void loadState(StateReader& reader) { kept_.loadState(reader); }

 private:
  void sample(float* rows, Rng& rng) const;

  const ContextEncoder& encoder_;
  ContextSettings settings_;
  ReplayBuffer kept_;
};

}  // namespace pmeta
