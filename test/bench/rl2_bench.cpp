// RL²: a whole iteration, acting included, in environments that cost nothing to step.
#include <memory>
#include <string>

#include "bench_util.h"
#include "pmeta_core/baselines/rl2.h"
#include "sac_update.h"

namespace bench {
namespace {

class NoiseFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int) const override { return "noise"; }
  std::string taskDescription(int) const override { return "noise"; }
  std::unique_ptr<pmeta::Env> create(int) const override {
    return std::make_unique<NoiseEnv>(20, 6);
  }
};

// products that no implementation can leave out, of one step: forward to act (without the critic),
// for the old densities and in each epoch, and there back by weights and, but for the inputs, by
// activations
double flopsOfStep(const pmeta::Rl2Networks& networks, int epochs) {
  const auto macs = [](const pmeta::Mlp& mlp) {
    return static_cast<double>(mlp.size() - mlp.spec().hidden.front() - mlp.outputs());
  };
  const auto gates = static_cast<double>(3 * networks.gru().units());
  const double input = gates * static_cast<double>(networks.gru().inputs());
  const double recurrent = gates * static_cast<double>(networks.gru().units());
  const double act = input + recurrent + macs(networks.mean());
  const double forward = act + macs(networks.value());
  return 2 * (act + forward + epochs * (3 * forward - input));
}

// floor: its operations at the fastest product's speed
void Rl2Iteration(benchmark::State& state) {
  const pmeta::Rl2Settings settings;
  pmeta::Rl2 rl2({std::make_shared<NoiseFamily>()}, settings);
  const auto& policies = static_cast<const pmeta::Rl2Policies&>(rl2.policies());
  pmeta::Model model(policies.layout());
  pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
  policies.initialise(model, rng);
  rl2.setModel(model);
  std::uint64_t iteration = 0;
  double ceiling = sgemmCeiling(256);
  const double seconds = callSeconds(state, 1, [&] { rl2.iterate(0, iteration++); });
  ceiling = std::max(ceiling, sgemmCeiling(256));
  const double steps = settings.trials * settings.episodes * 200;
  report({Part::kLoops, 8}, "RL2 iteration, 16 x 600 steps, 20+6, 128-128", Unit::kSeconds, seconds,
         steps * flopsOfStep(policies.networks(), settings.epochs) / ceiling, "its products");
}
BENCHMARK(Rl2Iteration)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace bench
