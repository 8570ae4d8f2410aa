// The neural loops: what the processor can do, what oneDNN reaches at our shapes, and what share of
// that floor a whole update needs. Times are of the calling thread's CPU.
#include <benchmark/benchmark.h>
#include <time.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/nn/gemm.h"
#include "pmeta_core/nn/kernels.h"
#include "pmeta_core/nn/mlp.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace {

using pmeta::AlignedFloats;
using pmeta::Transpose;

constexpr std::size_t kBatch = 64;
constexpr std::size_t kUnits = 512;

// seconds that this thread has computed
double threadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// the least time of `repetitions` calls, in seconds
template <class Call>
double leastSeconds(int repetitions, Call&& call) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const double start = threadSeconds();
    call();
    least = std::min(least, threadSeconds() - start);
  }
  return least;
}

AlignedFloats noise(std::size_t n, double size = 1) {
  pmeta::Rng rng(1, n, pmeta::Stream::kMeasure);
  AlignedFloats values(n);
  for (float& value : values) value = static_cast<float>(size * (2 * rng.uniform() - 1));
  return values;
}

#ifdef __x86_64__
// chains of multiply-adds: enough to fill two units of latency 4, few enough to stay in registers
constexpr int kFmaSteps = 200000;

__attribute__((target("avx512f"), noinline)) double fmaFlopsV4() {
  constexpr int kChains = 20;
  __m512 x[kChains];
  for (__m512& one : x) one = _mm512_set1_ps(1);
  const __m512 a = _mm512_set1_ps(0.999f), b = _mm512_set1_ps(0.001f);
  for (int i = 0; i < kFmaSteps; ++i) {
#pragma GCC unroll 20
    for (int j = 0; j < kChains; ++j) x[j] = _mm512_fmadd_ps(x[j], a, b);
  }
  for (const __m512& one : x) benchmark::DoNotOptimize(_mm512_cvtss_f32(one));
  return kFmaSteps * double(kChains) * 32;
}

__attribute__((target("avx2,fma"), noinline)) double fmaFlopsV3() {
  constexpr int kChains = 12;
  __m256 x[kChains];
  for (__m256& one : x) one = _mm256_set1_ps(1);
  const __m256 a = _mm256_set1_ps(0.999f), b = _mm256_set1_ps(0.001f);
  for (int i = 0; i < kFmaSteps; ++i) {
#pragma GCC unroll 12
    for (int j = 0; j < kChains; ++j) x[j] = _mm256_fmadd_ps(x[j], a, b);
  }
  for (const __m256& one : x) benchmark::DoNotOptimize(_mm256_cvtss_f32(one));
  return kFmaSteps * double(kChains) * 16;
}

// multiply-adds of one thread with the widest registers, counted as two operations each
void FmaPeak(benchmark::State& state) {
  const std::string widest = pmeta::kernelNames().front();
  if (widest == "default") {
    state.SkipWithError("no fused multiply-add on this machine");
    return;
  }
  double flops = 0;
  for (auto _ : state) flops += widest == "x86-64-v4" ? fmaFlopsV4() : fmaFlopsV3();
  state.SetLabel(widest);
  state.counters["FLOP/s"] = benchmark::Counter(flops, benchmark::Counter::kIsRate);
}
BENCHMARK(FmaPeak)->Unit(benchmark::kMillisecond);
#endif

// the three products of a 512 x 512 layer at one batch size
struct LayerProducts {
  explicit LayerProducts(std::size_t batch)
      : batch(batch),
        x(noise(batch * kUnits)),
        y(batch * kUnits),
        w(noise(kUnits * kUnits)),
        d(w) {}

  void forward() {
    pmeta::gemm(Transpose::kNo, Transpose::kYes, batch, kUnits, kUnits, 1, x.data(), kUnits,
                w.data(), kUnits, 0, y.data(), kUnits);
  }
  void weightGradient() {
    pmeta::gemm(Transpose::kYes, Transpose::kNo, kUnits, kUnits, batch, 1, x.data(), kUnits,
                y.data(), kUnits, 0, d.data(), kUnits);
  }
  void inputGradient() {
    pmeta::gemm(Transpose::kNo, Transpose::kNo, batch, kUnits, kUnits, 1, x.data(), kUnits,
                w.data(), kUnits, 0, y.data(), kUnits);
  }
  double flops() const { return 2.0 * static_cast<double>(batch * kUnits * kUnits); }

  std::size_t batch;
  AlignedFloats x, y, w, d;
};

void Sgemm(benchmark::State& state) {
  LayerProducts products(static_cast<std::size_t>(state.range(0)));
  const auto which = state.range(1);
  for (auto _ : state) {
    if (which == 0) products.forward();
    if (which == 1) products.weightGradient();
    if (which == 2) products.inputGradient();
    benchmark::ClobberMemory();
  }
  const char* kNames[] = {"forward", "weight gradient", "input gradient"};
  state.SetLabel(std::string(pmeta::gemmName()) + ", " + kNames[which]);
  state.counters["FLOP/s"] =
      benchmark::Counter(products.flops(), benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(Sgemm)
    ->ArgNames({"batch", "product"})
    ->ArgsProduct({{64, 256}, {0, 1, 2}})
    ->Unit(benchmark::kMicrosecond);

// operations a second of the fastest of a layer's three products
double sgemmCeiling() {
  LayerProducts products(kBatch);
  const double least = std::min({leastSeconds(60, [&] { products.forward(); }),
                                 leastSeconds(60, [&] { products.weightGradient(); }),
                                 leastSeconds(60, [&] { products.inputGradient(); })});
  return products.flops() / least;
}

// seconds that the optimiser's memory traffic takes by itself: four arrays of n floats read and
// written and one read, with one addition for each
double optimizerTrafficSeconds(std::size_t n) {
  AlignedFloats a(n), b(n), c(n), d(n), g(n);
  return leastSeconds(40, [&] {
    float* __restrict pa = a.data();
    float* __restrict pb = b.data();
    float* __restrict pc = c.data();
    float* __restrict pd = d.data();
    const float* __restrict pg = g.data();
    for (std::size_t k = 0; k < n; ++k) {
      pa[k] += pg[k];
      pb[k] += pg[k];
      pc[k] += pg[k];
      pd[k] += pg[k];
    }
    benchmark::ClobberMemory();
  });
}

// a DQN learner's update without its replay: two passes forward, one back, one of the optimiser
class DqnUpdate {
 public:
  DqnUpdate()
      : mlp({"q", 4, {kUnits, kUnits}, 2}),
        online(mlp, kBatch),
        target(mlp, kBatch),
        phi(mlp.size()),
        gradient(mlp.size()),
        observations(noise(kBatch * 4)),
        next_observations(noise(kBatch * 4, 0.9)),
        d_q(kBatch * 2),
        error(kBatch),
        d_error(kBatch),
        weight(kBatch, 0.5f) {
    pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
    mlp.initialise(phi.data(), rng);
    omega = target_phi = phi;
    settings.lambda = 20;
    optimizer =
        std::make_unique<pmeta::ProximalAdam>(phi.data(), omega.data(), mlp.size(), settings);
  }

  void operator()() {
    const float* next = mlp.forward(target_phi.data(), next_observations.data(), kBatch, target);
    const float* q = mlp.forward(phi.data(), observations.data(), kBatch, online);
    for (std::size_t b = 0; b < kBatch; ++b) {
      const float best = std::max(next[2 * b], next[2 * b + 1]);
      error[b] = q[2 * b + b % 2] - (1 + 0.99f * best);
    }
    pmeta::kernels().squaredLoss(error.data(), weight.data(), d_error.data(), kBatch);
    for (std::size_t b = 0; b < kBatch; ++b) {
      d_q[2 * b + b % 2] = d_error[b];
      d_q[2 * b + 1 - b % 2] = 0;
    }
    mlp.backward(phi.data(), observations.data(), kBatch, d_q.data(), gradient.data(), nullptr,
                 online);
    optimizer->beginUpdate();
    optimizer->apply(0, gradient.data(), mlp.size());
  }

  // four passes through the layers, but for the gradient by the observations
  double flops() const {
    const double weights = 4.0 * kUnits + 1.0 * kUnits * kUnits + 2.0 * kUnits;
    return 2 * kBatch * (4 * weights - 4.0 * kUnits);
  }

  pmeta::Mlp mlp;
  pmeta::MlpWorkspace online, target;
  AlignedFloats phi, omega, target_phi, gradient;
  AlignedFloats observations, next_observations, d_q, error, d_error, weight;
  pmeta::ProximalAdamSettings settings;
  std::unique_ptr<pmeta::ProximalAdam> optimizer;
};

void DqnUpdate64(benchmark::State& state) {
  DqnUpdate update;
  double ceiling = sgemmCeiling();
  double traffic = optimizerTrafficSeconds(update.mlp.size());
  double least = std::numeric_limits<double>::infinity();
  for (auto _ : state) least = std::min(least, leastSeconds(1, update));
  ceiling = std::max(ceiling, sgemmCeiling());
  traffic = std::min(traffic, optimizerTrafficSeconds(update.mlp.size()));
  const double floor = update.flops() / ceiling + traffic;
  state.counters["least_us"] = 1e6 * least;
  state.counters["floor_us"] = 1e6 * floor;
  state.counters["of_floor_%"] = 100 * floor / least;
  state.counters["sgemm_GFLOP/s"] = 1e-9 * ceiling;
}
BENCHMARK(DqnUpdate64)->Unit(benchmark::kMicrosecond);

// plain Adam (28 bytes a parameter) and with pull, auxiliary and target (44 bytes)
void FusedAdam(benchmark::State& state) {
  constexpr std::size_t kSize = 1000000;
  const bool proximal = state.range(0) != 0;
  AlignedFloats phi = noise(kSize), omega = phi, target = phi;
  const AlignedFloats gradient = noise(kSize, 1e-3);
  pmeta::ProximalAdamSettings settings;
  settings.lambda = proximal ? 15 : 0;
  pmeta::ProximalAdam optimizer(phi.data(), omega.data(), kSize, settings);
  if (proximal) optimizer.followWith(target.data(), 0.005);
  for (auto _ : state) {
    optimizer.beginUpdate();
    optimizer.apply(0, gradient.data(), kSize);
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(kSize) *
                          (proximal ? 44 : 28));
}
BENCHMARK(FusedAdam)->ArgName("proximal")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

// one observation, one action: DQN's network and an actor of SAC's size
void OneAction(benchmark::State& state) {
  const bool sac = state.range(0) != 0;
  const pmeta::Mlp mlp({"pi", sac ? 25u : 4u, {kUnits, kUnits}, sac ? 12u : 2u});
  pmeta::MlpWorkspace workspace(mlp, 1);
  AlignedFloats parameters(mlp.size());
  pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
  mlp.initialise(parameters.data(), rng);
  const AlignedFloats observation = noise(mlp.inputs());
  for (auto _ : state) {
    benchmark::DoNotOptimize(mlp.forward(parameters.data(), observation.data(), 1, workspace));
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(4 * mlp.size()));
}
BENCHMARK(OneAction)->ArgName("sac")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

// what a step of ten environments costs
void ForwardOfBatch(benchmark::State& state) {
  const auto batch = static_cast<std::size_t>(state.range(0));
  const pmeta::Mlp mlp({"q", 4, {kUnits, kUnits}, 2});
  pmeta::MlpWorkspace workspace(mlp, batch);
  AlignedFloats parameters(mlp.size());
  pmeta::Rng rng(0, 0, pmeta::Stream::kInitialise);
  mlp.initialise(parameters.data(), rng);
  const AlignedFloats observations = noise(batch * mlp.inputs());
  for (auto _ : state) {
    benchmark::DoNotOptimize(mlp.forward(parameters.data(), observations.data(), batch, workspace));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(ForwardOfBatch)->Arg(2)->Arg(4)->Arg(5)->Arg(10)->Unit(benchmark::kMicrosecond);

}  // namespace
