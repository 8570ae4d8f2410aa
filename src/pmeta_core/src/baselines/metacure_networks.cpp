#include "pmeta_core/baselines/metacure_networks.h"

#include <utility>

#include "pmeta_core/act/gaussian_actor.h"

namespace pmeta {

MetaCureNetworks::MetaCureNetworks(const EnvSpec& env, const MetaCureSettings& settings)
    : exploiter_(env, exploiterSettings(settings), settings.latent_size),
      explorer_(env, explorerSettings(settings), 2 * settings.latent_size),
      encoder_(env, settings) {}

std::vector<Block> MetaCureNetworks::blocks() const {
  std::vector<Block> all = exploiter_.blocks();
  for (const std::vector<Block>& more : {explorer_.blocks(), encoder_.blocks()}) {
    all.insert(all.end(), more.begin(), more.end());
  }
  return all;
}

void MetaCureNetworks::initialise(float* parameters, Rng& rng) const {
  exploiter_.initialise(parameters, rng);
  explorer_.initialise(parameters + explorerOffset(), rng);
  encoder_.initialise(parameters + encoderOffset(), rng);
}

MetaCurePolicies::MetaCurePolicies(const EnvSpec& env, const MetaCureSettings& settings)
    : PolicyFamily(ModelLayout(Precision::kFloat32, MetaCureNetworks(env, settings).blocks())),
      networks_(env, settings) {}

void MetaCurePolicies::initialise(Model& parameters, Rng& rng) const {
  networks_.initialise(parameters.floats().data(), rng);
}

std::unique_ptr<Actor> MetaCurePolicies::actor(const Model& parameters,
                                               std::vector<float> task_input,
                                               std::size_t max_batch) const {
  return std::make_unique<GaussianActor>(networks_.exploiter().actor(), std::move(task_input),
                                         max_batch, GaussianActor::By::kMean,
                                         parameters.floats().data());
}

}  // namespace pmeta
