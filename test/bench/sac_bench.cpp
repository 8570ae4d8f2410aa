// Soft actor-critic: a whole update, also PEARL's, an action, and the context encoder.
#include "bench_util.h"
#include "pearl_update.h"
#include "sac_update.h"

namespace bench {
namespace {

// floor: its operations at the fastest product's speed, then the optimiser's floor
void SacUpdateOf(benchmark::State& state) {
  const auto units = static_cast<std::size_t>(state.range(0));
  const auto batch = static_cast<std::size_t>(state.range(1));
  SacUpdate update(units, batch, "none");
  double ceiling = sgemmCeiling(batch);
  double adam = update.adamSeconds();
  const double seconds = callSeconds(state, 1, update);
  ceiling = std::max(ceiling, sgemmCeiling(batch));
  adam = std::min(adam, update.adamSeconds());
  const std::string size = std::to_string(units);
  report({Part::kLoops, units == 512 ? 4 : 5},
         "SAC update, 25+6, [" + size + "," + size + "], batch " + std::to_string(batch),
         Unit::kSeconds, seconds, update.flops() / ceiling + adam, "products, then Adam");
}
BENCHMARK(SacUpdateOf)
    ->ArgNames({"units", "batch"})
    ->Args({512, 256})
    ->Args({128, 128})
    ->Unit(benchmark::kMicrosecond);

// PEARL's with its default settings
void PearlUpdateOf(benchmark::State& state) {
  PearlUpdate update;
  double ceiling = sgemmCeiling(update.rows());
  double adam = update.adamSeconds();
  const double seconds = callSeconds(state, 1, update);
  ceiling = std::max(ceiling, sgemmCeiling(update.rows()));
  adam = std::min(adam, update.adamSeconds());
  report({Part::kLoops, 8}, "PEARL update, 20+6, [128,128], 4 tasks of 64 and 128 rows of context",
         Unit::kSeconds, seconds, update.flops() / ceiling + adam, "products, then Adam");
}
BENCHMARK(PearlUpdateOf)->Unit(benchmark::kMicrosecond);

// an environment step by a sample of the policy, kept in the replay
void SacStep(benchmark::State& state) {
  SacUpdate sac(512, 256, "none");
  const std::size_t actor = sac.learner.networks().actor().size();
  double read = readSeconds(actor);
  const double seconds = callSeconds(state, 4, [&] { sac.collect(); });
  read = std::min(read, readSeconds(actor));
  report({Part::kLoops, 12}, "SAC step: sample of 25-512-512-12, stored", Unit::kSeconds, seconds,
         read, "reading the actor once");
}
BENCHMARK(SacStep)->Unit(benchmark::kMicrosecond);

// q(z|c) of 100 transitions
void ContextInference(benchmark::State& state) {
  pmeta::ContextSettings settings;
  const pmeta::ContextEncoder encoder(25, 6, settings);
  const auto rows = static_cast<std::size_t>(settings.batch_size);
  pmeta::ContextEncoder::Workspace workspace(encoder, rows);
  pmeta::AlignedFloats parameters(encoder.network().size());
  pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
  encoder.network().initialise(parameters.data(), rng);
  const pmeta::AlignedFloats context = noise(rows * encoder.rowSize());
  pmeta::LatentPosterior posterior;
  double ceiling = sgemmCeiling(rows);
  const double seconds = callSeconds(state, 4, [&] {
    encoder.infer(parameters.data(), context.data(), rows, workspace, posterior);
    benchmark::ClobberMemory();
  });
  ceiling = std::max(ceiling, sgemmCeiling(rows));
  // multiply-adds: the weights, once for each row
  const double flops = 2.0 * static_cast<double>(rows) * static_cast<double>(parameters.size());
  report({Part::kLoops, 7}, "context encoding, 100 rows, 32-200-200-200-10", Unit::kSeconds,
         seconds, flops / ceiling, "its products");
}
BENCHMARK(ContextInference)->Unit(benchmark::kMicrosecond);

// what the inference network adds to an update
void SacUpdateWithEncoder(benchmark::State& state) {
  SacUpdate update(512, 256, "inference"), without(512, 256, "none");
  double plain = callSeconds(20, 1, without);
  const double seconds = callSeconds(state, 1, update);
  plain = std::min(plain, callSeconds(20, 1, without));
  report({Part::kLoops, 6}, "SAC update with the context encoder, batch 256", Unit::kSeconds,
         seconds, plain, "the update without it");
}
BENCHMARK(SacUpdateWithEncoder)->Unit(benchmark::kMicrosecond);

// what the same bits on every processor cost
void SacUpdatePortable(benchmark::State& state) {
  const auto units = static_cast<std::size_t>(state.range(0));
  const auto batch = static_cast<std::size_t>(state.range(1));
  SacUpdate update(units, batch, "none", true), native(units, batch, "none");
  double fast = callSeconds(20, 1, native);
  const double seconds = callSeconds(state, 1, update);
  fast = std::min(fast, callSeconds(20, 1, native));
  const std::string size = std::to_string(units);
  report({Part::kLoops, units == 512 ? 13 : 14},
         "SAC update, arithmetic portable, [" + size + "," + size + "], batch " +
             std::to_string(batch),
         Unit::kSeconds, seconds, fast, "arithmetic native");
}
BENCHMARK(SacUpdatePortable)
    ->ArgNames({"units", "batch"})
    ->Args({512, 256})
    ->Args({128, 128})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
