// The neural loops: a whole update, its optimiser, and acting.
#include "bench_util.h"
#include "dqn_update.h"

namespace bench {

double dqnUpdateSeconds() {
  DqnUpdate update;
  return callSeconds(20, 1, update);
}

namespace {

// floor: its operations at the fastest product's speed, then the optimiser's floor
void DqnUpdate64(benchmark::State& state) {
  DqnUpdate update;
  double ceiling = sgemmCeiling(kBatch);
  double traffic = adamFloorSeconds(update.parameters(), 4);
  const double seconds = callSeconds(state, 1, update);
  ceiling = std::max(ceiling, sgemmCeiling(kBatch));
  traffic = std::min(traffic, adamFloorSeconds(update.parameters(), 4));
  report({Part::kLoops, 0}, "DQN update, 4-512-512-2, batch 64, Adam, pull", Unit::kSeconds,
         seconds, DqnUpdate::flops() / ceiling + traffic, "products, then Adam");
}
BENCHMARK(DqnUpdate64)->Unit(benchmark::kMicrosecond);

// plain Adam (28 bytes a parameter); with pull and auxiliary (36); and a target that follows (44)
void FusedAdam(benchmark::State& state) {
  constexpr std::size_t kSize = 1000000;
  const int extras = static_cast<int>(state.range(0));
  pmeta::AlignedFloats phi = noise(kSize), omega = phi, target = phi;
  const pmeta::AlignedFloats gradient = noise(kSize, 1e-3);
  pmeta::ProximalAdamSettings settings;
  settings.lambda = extras > 0 ? 15 : 0;
  pmeta::ProximalAdam optimizer(phi.data(), omega.data(), kSize, settings);
  double traffic = adamFloorSeconds(kSize, 3 + extras);
  const double seconds = callSeconds(state, 1, [&] {
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), kSize, extras > 1 ? target.data() : nullptr, 0.005);
  });
  traffic = std::min(traffic, adamFloorSeconds(kSize, 3 + extras));
  const char* kNames[] = {"Adam, 1 M parameters", "Adam, pull, auxiliary, 1 M parameters",
                          "Adam, pull, auxiliary, target, 1 M parameters"};
  report({Part::kLoops, 1 + extras}, kNames[extras], Unit::kSeconds, seconds, traffic,
         "its " + std::to_string(28 + 8 * extras) + " MB, roots and divisions");
}
BENCHMARK(FusedAdam)->ArgName("extras")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);

// passes forward through a network of `inputs` and `outputs`, `batch` observations at a time
double forwardSeconds(benchmark::State& state, const pmeta::Mlp& mlp, std::size_t batch) {
  pmeta::MlpWorkspace workspace(mlp, batch);
  pmeta::AlignedFloats parameters(mlp.size());
  pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
  mlp.initialise(parameters.data(), rng);
  const pmeta::AlignedFloats observations = noise(batch * mlp.inputs());
  return callSeconds(state, 4, [&] {
    benchmark::DoNotOptimize(mlp.forward(parameters.data(), observations.data(), batch, workspace));
    benchmark::ClobberMemory();
  });
}

// one observation, one action: DQN's network and an actor of SAC's size
void OneAction(benchmark::State& state) {
  const bool sac = state.range(0) != 0;
  const pmeta::Mlp mlp({"pi", sac ? 25u : 4u, {kUnits, kUnits}, sac ? 12u : 2u});
  double read = readSeconds(mlp.size());
  const double seconds = forwardSeconds(state, mlp, 1);
  read = std::min(read, readSeconds(mlp.size()));
  report({Part::kLoops, sac ? 11 : 10},
         sac ? "one action, 25-512-512-12" : "one action, 4-512-512-2", Unit::kSeconds, seconds,
         read, "reading its parameters once");
}
BENCHMARK(OneAction)->ArgName("sac")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

// what a step of several environments costs
void ForwardOfBatch(benchmark::State& state) {
  const auto batch = static_cast<std::size_t>(state.range(0));
  const double update = dqnUpdateSeconds();
  const double seconds = forwardSeconds(state, pmeta::Mlp({"q", 4, {kUnits, kUnits}, 2}), batch);
  report({Part::kShareOfUpdate, static_cast<int>(batch)},
         "actions of " + std::to_string(batch) + " environments", Unit::kSeconds, seconds, update,
         "DQN update");
}
BENCHMARK(ForwardOfBatch)->Arg(2)->Arg(5)->Arg(10)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
