// What makes up a round besides networks: the aggregation, and a tabular agent's work.
#include <memory>
#include <vector>

#include "bench_util.h"
#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/aggregate/trimmed_mix.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/task_agent.h"
#include "pmeta_core/security/authentication.h"

namespace bench {
namespace {

constexpr std::size_t kAgents = 100;
constexpr std::size_t kParameters = 1000000;

// models of 100 agents, with other numbers in each; too large together for any cache
const std::vector<pmeta::Model>& models() {
  static const std::vector<pmeta::Model> kModels = [] {
    const pmeta::ModelLayout layout(pmeta::Precision::kFloat32, {{"network", {kParameters}}});
    std::vector<pmeta::Model> all;
    for (std::size_t i = 0; i < kAgents; ++i) {
      all.emplace_back(layout);
      std::vector<float>& values = all.back().floats();
      for (std::size_t k = 0; k < values.size(); ++k) {
        values[k] = static_cast<float>(i) + 1e-6f * static_cast<float>(k);
      }
    }
    return all;
  }();
  return kModels;
}

void readModels() {
  float sum = 0;
  for (const pmeta::Model& model : models()) sum += readAll(model.floats().data(), kParameters);
  benchmark::DoNotOptimize(sum);
}

void Aggregate(benchmark::State& state) {
  std::vector<pmeta::Contribution> contributions;
  for (const pmeta::Model& model : models()) contributions.push_back({&model, 1.0});
  pmeta::Model meta(models().front().layout);
  double read = callSeconds(3, 1, readModels);
  const double seconds = callSeconds(state, 1, [&] {
    pmeta::mixInto(meta, contributions, 0.5);
    benchmark::DoNotOptimize(meta.floats().data());
  });
  read = std::min(read, callSeconds(3, 1, readModels));
  const double bytes = kAgents * kParameters * sizeof(float);
  report({Part::kLoops, 30}, "aggregating 100 agents x 1 M float32", Unit::kBytes, bytes / seconds,
         bytes / read, "reading them once");
}
BENCHMARK(Aggregate)->Unit(benchmark::kMillisecond);

// the robust rules beside the mean
void aggregateTrimmed(benchmark::State& state, double trim, int row, const std::string& rule) {
  std::vector<pmeta::Contribution> contributions;
  for (const pmeta::Model& model : models()) contributions.push_back({&model, 1.0});
  pmeta::Model meta(models().front().layout);
  double read = callSeconds(3, 1, readModels);
  const double seconds = callSeconds(state, 1, [&] {
    pmeta::mixTrimmedInto(meta, contributions, 0.5, trim);
    benchmark::DoNotOptimize(meta.floats().data());
  });
  read = std::min(read, callSeconds(3, 1, readModels));
  const double bytes = kAgents * kParameters * sizeof(float);
  report({Part::kLoops, row}, "the same, by " + rule, Unit::kBytes, bytes / seconds, bytes / read,
         "reading them once");
}
BENCHMARK_CAPTURE(aggregateTrimmed, median, 0.5, 32, "median")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(aggregateTrimmed, trimmed_mean, 0.2, 33, "trimmed mean")
    ->Unit(benchmark::kMillisecond);

// signing an update of 4 MB; to check one is the same and a comparison of 32 bytes
void Authenticate(benchmark::State& state) {
  const pmeta::Authenticator authenticator(pmeta::Key{1, 2, 3});
  pmeta::ModelView view;
  view.layout = models().front().layout.text();
  view.floats = models().front().floats().data();
  view.num_floats = kParameters;
  const pmeta::AuxiliaryUpdate header;
  const pmeta::Mac expected = authenticator.mac(header, view);
  const double seconds = callSeconds(state, 1, [&] {
    const pmeta::Mac mac = authenticator.mac(header, view);
    benchmark::DoNotOptimize(pmeta::Authenticator::compare(mac, expected));
  });
  report({Part::kLoops, 34}, "MAC of 1 M float32, made or checked", Unit::kSeconds, seconds);
}
BENCHMARK(Authenticate)->Unit(benchmark::kMillisecond);

// seconds of drawing as many transitions as a round does, with nothing learnt from them
double drawingSeconds(int samples) {
  const pmeta::Gridworld env({8, 7, 7, 0}, 8);
  const std::vector<int>& states = env.ownedStates();
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  return callSeconds(40, 1, [&] {
    for (int i = 0; i < samples; ++i) {
      const int s = states[rng.below(states.size())];
      benchmark::DoNotOptimize(&env.sample(s, static_cast<int>(rng.below(4)), rng));
    }
  });
}

// one round of the 8x8 task: R = 3 updates of 2 |S||A| samples, evaluation, a copy of the table
void TabularRound(benchmark::State& state) {
  const auto experiment = pmeta::Experiment::parse("run_id: bench", "bench");
  pmeta::TaskAgent agent(experiment, 4);
  pmeta::MetaPolicy meta;
  meta.model = pmeta::Model(agent.layout());
  std::int64_t samples = 0;
  const double seconds = callSeconds(state, 1, [&] {
    auto result = agent.trainRound(meta);
    samples = result->env_steps;
    benchmark::DoNotOptimize(result);
  });
  report({Part::kLoops, 31}, "tabular round, 8 x 8, " + std::to_string(samples) + " samples",
         Unit::kSeconds, seconds, drawingSeconds(static_cast<int>(samples)), "drawing the samples");
}
BENCHMARK(TabularRound)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
