#include "pmeta_core/learn/context_store.h"

#include <algorithm>

namespace pmeta {

InferredTask::InferredTask(const ContextEncoder& encoder, const ContextSettings& settings)
    : rows(static_cast<std::size_t>(settings.batch_size) * encoder.rowSize()),
      workspace(encoder, static_cast<std::size_t>(settings.batch_size)),
      posterior{std::vector<double>(encoder.latentSize()),
                std::vector<double>(encoder.latentSize())},
      noise(encoder.latentSize()),
      z(encoder.latentSize()),
      d_z(encoder.latentSize()) {}

ContextStore::ContextStore(const ContextEncoder& encoder, const ContextSettings& settings,
                           int observation_size, int action_size)
    : encoder_(encoder),
      settings_(settings),
      kept_(static_cast<std::size_t>(settings.buffer_size), observation_size, action_size) {}

void ContextStore::sample(float* rows, Rng& rng) const {
  const std::size_t kept = kept_.size();
  std::size_t window = kept, first = 0;
  if (settings_.window > 0 && static_cast<std::size_t>(settings_.window) < kept) {
    window = static_cast<std::size_t>(settings_.window);
    const std::size_t oldest = kept < kept_.capacity() ? 0 : kept_.next();
    first = oldest + rng.below(kept - window + 1);
  }
  for (int i = 0; i < settings_.batch_size; ++i, rows += encoder_.rowSize()) {
    encoder_.writeRow(kept_[(first + rng.below(window)) % kept], rows);
  }
}

void ContextStore::draw(const float* parameters, Rng& rng, InferredTask& task) const {
  sample(task.rows.data(), rng);
  encoder_.infer(parameters, task.rows.data(), static_cast<std::size_t>(settings_.batch_size),
                 task.workspace, task.posterior);
  drawLatent(task.posterior, rng, task.noise.data(), task.z.data());
}

LatentPosterior ContextStore::posterior(const float* parameters) const {
  const std::size_t n = kept_.size();
  std::vector<float> rows(n * encoder_.rowSize());
  for (std::size_t i = 0; i < n; ++i) {
    encoder_.writeRow(kept_[i], &rows[i * encoder_.rowSize()]);
  }
  ContextEncoder::Workspace workspace(encoder_, std::max<std::size_t>(1, n));
  LatentPosterior posterior;
  encoder_.infer(parameters, rows.data(), n, workspace, posterior);
  return posterior;
}

}  // namespace pmeta
