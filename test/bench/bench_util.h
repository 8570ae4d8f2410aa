#pragma once

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/nn/aligned.h"

#if defined(__x86_64__) && !defined(__clang__)
#define WIDEST_VECTORS __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define WIDEST_VECTORS
#endif

namespace bench {

/// Seconds that this thread has computed: other programs on the core do not count.
inline double threadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What a call takes undisturbed: the tenth percentile of `times`, which is reordered. Not the
/// least of them: the CPU clock of a virtual machine stands still where the host takes time back.
inline double undisturbed(std::vector<double>& times) {
  const auto tenth = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 10);
  std::nth_element(times.begin(), tenth, times.end());
  return *tenth;
}

/// CPU seconds of one call, averaged over `batch` of them.
template <class Call>
double meanSeconds(int batch, Call&& call) {
  const double start = threadSeconds();
  for (int j = 0; j < batch; ++j) call();
  return (threadSeconds() - start) / batch;
}

/// Seconds of one call, undisturbed, from `repetitions` batches. Reading the clock takes 0.3 us:
/// let a batch take 30 us or more.
template <class Call>
double callSeconds(int repetitions, int batch, Call&& call) {
  std::vector<double> times;
  for (int i = 0; i < repetitions; ++i) times.push_back(meanSeconds(batch, call));
  return undisturbed(times);
}

/// The same for as long as the benchmark runs; the median becomes a counter too.
template <class Call>
double callSeconds(benchmark::State& state, int batch, Call&& call) {
  std::vector<double> times;
  for (auto _ : state) times.push_back(meanSeconds(batch, call));
  const double seconds = undisturbed(times);
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  state.SetItemsProcessed(state.iterations() * batch);
  state.counters["call_us"] = 1e6 * seconds;
  state.counters["median_us"] = 1e6 * *middle;
  return seconds;
}

/// Parts of the closing table, in its order.
enum class Part { kProcessor, kLoops, kShareOfUpdate };

/// Where a row stands, since benchmarks run in random order.
struct Place {
  Part part;
  int row;
};

/// How a row's numbers are written.
enum class Unit { kSeconds, kFlops, kBytes };

/// Adds what one repetition found to the row `name`; the best of all repetitions counts, of what
/// was measured and of the limit each by itself. `limit_name` says what the limit is; without one
/// (limit 0) the row has no share. In kShareOfUpdate the limit is the whole of a DQN update.
void report(Place place, const std::string& name, Unit unit, double measured, double limit = 0,
            const std::string& limit_name = "");

/// Numbers in [-size, size), always the same.
pmeta::AlignedFloats noise(std::size_t n, double size = 1);

/// Reads n floats once, and does nothing else of note.
float readAll(const float* x, std::size_t n);

/// Seconds of reading n floats that were read before: from whichever cache holds as many.
double readSeconds(std::size_t n);

/// Seconds that Adam on n parameters needs at least: the longer of its memory traffic, `written`
/// arrays of n floats read and written and one read, and of a root and a division for each.
double adamFloorSeconds(std::size_t n, int written);

/// Operations a second of the fastest product of a 512 x 512 layer at that batch size.
double sgemmCeiling(std::size_t batch);

/// Seconds of a DQN update (dqn_update.h).
double dqnUpdateSeconds();

}  // namespace bench
