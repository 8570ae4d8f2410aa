#include "pmeta_core/baselines/rl2_networks.h"

#include <algorithm>

#include "pmeta_core/base/error.h"
#include "pmeta_core/baselines/rl2_actor.h"

namespace pmeta {
namespace {

const EnvSpec& requireContinuous(const EnvSpec& env) {
  if (env.num_actions > 0) {
    throw Error("environment '" + env.name + "' has discrete actions: rl2 needs continuous ones.");
  }
  return env;
}

MlpSpec head(const char* prefix, const Rl2Settings& settings, std::size_t outputs) {
  MlpSpec spec = mlpSpec(prefix, static_cast<std::size_t>(settings.hidden), settings.head, outputs,
                         settings.portable);
  spec.activation = Activation::kTanh;
  return spec;
}

}  // namespace

Rl2Networks::Rl2Networks(const EnvSpec& env, const Rl2Settings& settings)
    : observation_size_(static_cast<std::size_t>(requireContinuous(env).observation_size)),
      action_size_(static_cast<std::size_t>(env.action_size)),
      initialisation_(settings.initialisation == "glorot" ? Initialisation::kGlorot
                                                          : Initialisation::kOrthogonal),
      initial_log_std_(static_cast<float>(settings.initial_log_std)),
      gru_({"gru", observation_size_ + lastSize(), static_cast<std::size_t>(settings.hidden),
            settings.portable}),
      mean_(head("mean", settings, action_size_)),
      value_(head("value", settings, 1)) {}

std::vector<Block> Rl2Networks::blocks() const {
  std::vector<Block> all = gru_.blocks();
  all.insert(all.end(), mean_.blocks().begin(), mean_.blocks().end());
  all.insert(all.end(), value_.blocks().begin(), value_.blocks().end());
  all.push_back({"log_std", {action_size_}});
  return all;
}

void Rl2Networks::initialise(float* parameters, Rng& rng) const {
  pmeta::initialise(blocks(), initialisation_, parameters, rng);
  std::fill_n(parameters + logStdOffset(), action_size_, initial_log_std_);
}

Rl2Policies::Rl2Policies(const EnvSpec& env, const Rl2Settings& settings)
    : PolicyFamily(ModelLayout(Precision::kFloat32, Rl2Networks(env, settings).blocks())),
      networks_(env, settings) {}

void Rl2Policies::initialise(Model& parameters, Rng& rng) const {
  networks_.initialise(parameters.floats().data(), rng);
}

std::unique_ptr<Actor> Rl2Policies::actor(const Model& parameters, std::vector<float>,
                                          std::size_t max_batch) const {
  return std::make_unique<Rl2Actor>(networks_, parameters.floats().data(), max_batch,
                                    TrialMemory(networks_));
}

}  // namespace pmeta
