// What the processor can do, and what the matrix products reach of it at our shapes.
#ifdef __x86_64__
#include <immintrin.h>
#endif

#include "bench_util.h"
#include "dqn_update.h"
#include "pmeta_core/nn/gemm.h"

namespace bench {
namespace {

using pmeta::Transpose;

constexpr int kFmaSteps = 20000;

#ifdef __x86_64__
// chains of multiply-adds: enough to fill two units of latency 4, few enough to stay in registers
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
#endif

// the call that keeps the multiply-add units of the widest registers busy, which returns how many
// operations it did (two for each); null where there are none
double (*fmaLoop())() {
#ifdef __x86_64__
  const std::string widest = pmeta::kernelNames().front();
  if (widest == "x86-64-v4") return fmaFlopsV4;
  if (widest == "x86-64-v3") return fmaFlopsV3;
#endif
  return nullptr;
}

// operations a second; 0 where they cannot be measured
double fmaPeak() {
  const auto loop = fmaLoop();
  if (loop == nullptr) return 0;
  double flops = 0;
  return 1 / callSeconds(40, 1, [&] { flops = loop(); }) * flops;
}

void FmaPeak(benchmark::State& state) {
  const auto loop = fmaLoop();
  if (loop == nullptr) {
    state.SkipWithError("no fused multiply-add on this machine");
    return;
  }
  double flops = 0;
  const double seconds = callSeconds(state, 1, [&] { flops = loop(); });
  state.SetLabel(pmeta::kernelNames().front());
  report({Part::kProcessor, 0}, "multiply-adds, " + pmeta::kernelNames().front(), Unit::kFlops,
         flops / seconds);
}
BENCHMARK(FmaPeak)->Unit(benchmark::kMicrosecond);

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
  pmeta::AlignedFloats x, y, w, d;
};

void Sgemm(benchmark::State& state) {
  LayerProducts products(static_cast<std::size_t>(state.range(0)));
  const auto which = state.range(1);
  const char* kNames[] = {"forward", "weight gradient", "input gradient"};
  double peak = fmaPeak();
  const double seconds = callSeconds(state, 1, [&] {
    if (which == 0) products.forward();
    if (which == 1) products.weightGradient();
    if (which == 2) products.inputGradient();
    benchmark::ClobberMemory();
  });
  peak = std::max(peak, fmaPeak());
  state.SetLabel(std::string(pmeta::gemmName()) + ", " + kNames[which]);
  const std::string name = std::string("512 x 512 ") + kNames[which] + ", batch ";
  const int row = static_cast<int>(state.range(0) + which);
  report({Part::kProcessor, row}, name + std::to_string(state.range(0)), Unit::kFlops,
         products.flops() / seconds, peak, "multiply-adds");
}
BENCHMARK(Sgemm)
    ->ArgNames({"batch", "product"})
    ->ArgsProduct({{64, 256}, {0, 1, 2}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace

double sgemmCeiling(std::size_t batch) {
  LayerProducts products(batch);
  const double seconds = std::min({callSeconds(60, 1, [&] { products.forward(); }),
                                   callSeconds(60, 1, [&] { products.weightGradient(); }),
                                   callSeconds(60, 1, [&] { products.inputGradient(); })});
  return products.flops() / seconds;
}

}  // namespace bench
