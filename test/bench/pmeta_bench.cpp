// pmeta_bench: the inner loops, each as a share of what this machine can do, measured in the same
// run
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/task_agent.h"

#if defined(__x86_64__) && !defined(__clang__)
#define WIDEST_VECTORS __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define WIDEST_VECTORS
#endif

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

// the plainest possible use of the memory bus: read every float once
WIDEST_VECTORS float readAll(const float* x, std::size_t n) {
  constexpr std::size_t kLanes = 128;
  float sums[kLanes] = {};
  for (std::size_t k = 0; k + kLanes <= n; k += kLanes) {
    for (std::size_t j = 0; j < kLanes; ++j) sums[j] += x[k + j];
  }
  float sum = 0;
  for (const float lane : sums) sum += lane;
  return sum;
}

double peakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

void ReadBandwidth(benchmark::State& state) {
  const auto& all = models();
  for (auto _ : state) {
    float sum = 0;
    for (const pmeta::Model& model : all) sum += readAll(model.floats().data(), kParameters);
    benchmark::DoNotOptimize(sum);
  }
  state.SetBytesProcessed(state.iterations() * kAgents * kParameters * sizeof(float));
}

void Aggregate(benchmark::State& state) {
  std::vector<pmeta::Contribution> contributions;
  for (const pmeta::Model& model : models()) contributions.push_back({&model, 1.0});
  pmeta::Model meta(models().front().layout);
  const double before = peakMegabytes();
  for (auto _ : state) {
    pmeta::mixInto(meta, contributions, 0.5);
    benchmark::DoNotOptimize(meta.floats().data());
  }
  state.counters["extra_MB"] = peakMegabytes() - before;
  state.SetBytesProcessed(state.iterations() * kAgents * kParameters * sizeof(float));
}

void GridworldStep(benchmark::State& state) {
  pmeta::Gridworld env({8, 7, 7, 0}, 8);
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  double observation[2];
  env.reset(rng, observation);
  for (auto _ : state) {
    const double action = static_cast<double>(rng.below(4));
    const pmeta::Step step = env.step(&action, rng, observation);
    if (step.terminated || step.truncated) env.reset(rng, observation);
    benchmark::DoNotOptimize(observation);
  }
  state.SetItemsProcessed(state.iterations());
}

// one round of the 8x8 task: R = 3 updates of 2 |S||A| samples, evaluation, a copy of the table
void TabularRound(benchmark::State& state) {
  const auto experiment = pmeta::Experiment::parse("run_id: bench", "bench");
  pmeta::TaskAgent agent(experiment, 4);
  pmeta::MetaPolicy meta;
  meta.model = pmeta::Model(agent.layout());
  std::int64_t samples = 0;
  for (auto _ : state) {
    auto result = agent.trainRound(meta);
    samples += result->personal.env_steps;
    benchmark::DoNotOptimize(result);
  }
  state.SetItemsProcessed(samples);
}

BENCHMARK(ReadBandwidth)->Unit(benchmark::kMillisecond);
BENCHMARK(Aggregate)->Unit(benchmark::kMillisecond);
BENCHMARK(GridworldStep);
BENCHMARK(TabularRound)->Unit(benchmark::kMicrosecond);

// keeps the best repetition of each benchmark
class BestOf : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const auto rate = run.counters.find("bytes_per_second");
      if (rate == run.counters.end()) continue;
      double& best = bytes_per_second[run.run_name.function_name];
      best = std::max(best, static_cast<double>(rate->second.value));
    }
    ConsoleReporter::ReportRuns(runs);
  }

  std::map<std::string, double> bytes_per_second;
};

}  // namespace

int main(int argc, char** argv) {
  // repetitions in random order, so that a busy moment does not hit one benchmark alone
  std::vector<char*> arguments(argv, argv + argc);
  std::string repetitions = "--benchmark_repetitions=5";
  std::string interleaving = "--benchmark_enable_random_interleaving=true";
  arguments.insert(arguments.begin() + 1, {&repetitions[0], &interleaving[0]});
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 1;

  BestOf reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  const double limit = reporter.bytes_per_second["ReadBandwidth"];
  const double reached = reporter.bytes_per_second["Aggregate"];
  if (limit > 0 && reached > 0) {
    std::printf(
        "\naggregating %zu agents x %zu float32: %.2f GB/s, %.0f %% of the read bandwidth "
        "(%.2f GB/s)\n",
        kAgents, kParameters, reached / 1e9, 100 * reached / limit, limit / 1e9);
  }
  return 0;
}
