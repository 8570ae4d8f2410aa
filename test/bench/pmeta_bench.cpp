// pmeta_bench: the inner loops, each beside what this machine can do, measured in the same run
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "bench_util.h"

namespace bench {
namespace {

struct Row {
  Place place;
  std::string name;
  Unit unit;
  double measured;
  double limit;
  std::string limit_name;
};

std::vector<Row>& rows() {
  static std::vector<Row> rows;
  return rows;
}

std::string text(double value, Unit unit) {
  char buffer[40];
  if (unit == Unit::kFlops) {
    std::snprintf(buffer, sizeof buffer, "%.1f GFLOP/s", 1e-9 * value);
  } else if (unit == Unit::kBytes) {
    std::snprintf(buffer, sizeof buffer, "%.1f GB/s", 1e-9 * value);
  } else {
    const char* kNames[] = {"ns", "us", "ms"};
    int power = 0;
    for (value *= 1e9; value >= 1000 && power < 2; value /= 1000) ++power;
    std::snprintf(buffer, sizeof buffer, "%.3g %s", value, kNames[power]);
  }
  return buffer;
}

void printPart(Part part, const char* title, const char* limit_title) {
  bool first = true;
  for (const Row& row : rows()) {
    if (row.place.part != part) continue;
    if (first) {
      std::printf("\n%-48s %14s   %-44s %6s\n", title, "measured", limit_title, "share");
    }
    first = false;
    std::printf("%-48s %14s", row.name.c_str(), text(row.measured, row.unit).c_str());
    if (row.limit > 0) {
      // rates: the more the better; times: the less. Of an update the row is a part
      const bool larger_is_limit = row.unit != Unit::kSeconds || part == Part::kShareOfUpdate;
      const double share = larger_is_limit ? row.measured / row.limit : row.limit / row.measured;
      const std::string limit = row.limit_name + ": " + text(row.limit, row.unit);
      const int decimals = share >= 0.1 ? 0 : share >= 0.001 ? 1 : 3;
      std::printf("   %-44s %5.*f %%", limit.c_str(), decimals, 100 * share);
    }
    std::printf("\n");
  }
}

// one line for each benchmark: the median of its repetitions
class MedianReporter : public benchmark::ConsoleReporter {
 public:
  MedianReporter() : ConsoleReporter(isatty(STDOUT_FILENO) ? OO_ColorTabular : OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    std::vector<Run> medians;
    for (const Run& run : runs) {
      if (run.aggregate_name == "median" || run.repetitions == 1) medians.push_back(run);
    }
    if (!medians.empty()) ConsoleReporter::ReportRuns(medians);
  }
};

}  // namespace

void report(Place place, const std::string& name, Unit unit, double measured, double limit,
            const std::string& limit_name) {
  for (Row& row : rows()) {
    if (row.name != name) continue;
    const bool time = unit == Unit::kSeconds;
    row.measured = time ? std::min(row.measured, measured) : std::max(row.measured, measured);
    row.limit = time ? std::min(row.limit, limit) : std::max(row.limit, limit);
    return;
  }
  rows().push_back({place, name, unit, measured, limit, limit_name});
  std::sort(rows().begin(), rows().end(),
            [](const Row& a, const Row& b) { return a.place.row < b.place.row; });
}

}  // namespace bench

int main(int argc, char** argv) {
  // repetitions in random order, so that a busy moment does not hit one benchmark alone
  std::string defaults[] = {"--benchmark_repetitions=5", "--benchmark_min_time=0.2",
                            "--benchmark_enable_random_interleaving=true"};
  std::vector<char*> arguments(argv, argv + argc);
  for (std::string& option : defaults) arguments.insert(arguments.begin() + 1, &option[0]);
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 1;

  bench::MedianReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  if (bench::rows().empty()) return 0;
  std::printf("\nCPU time of one thread: the tenth percentile of its calls, best repetition\n");
  bench::printPart(bench::Part::kProcessor, "processor", "limit in the same run");
  bench::printPart(bench::Part::kLoops, "inner loop", "limit in the same run");
  bench::printPart(bench::Part::kShareOfUpdate, "beside the DQN update", "the update");
  return 0;
}
