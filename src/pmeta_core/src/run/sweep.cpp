#include "pmeta_core/run/sweep.h"

#include <chrono>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <mutex>
#include <regex>
#include <sstream>
#include <thread>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

struct Axis {
  std::string key;
  std::vector<std::string> values;
};

// "1,5,10", "0-9" or "[1,2],[3,4]": commas inside brackets belong to a value
std::vector<std::string> expandValues(const std::string& text) {
  std::smatch range;
  static const std::regex kRange("([0-9]+)-([0-9]+)");
  std::vector<std::string> values;
  if (std::regex_match(text, range, kRange)) {
    const long first = std::stol(range[1]);
    const long last = std::stol(range[2]);
    if (last < first || last - first > 100000) {
      throw Error("the range " + text + " must go up, by at most 100000.");
    }
    for (long value = first; value <= last; ++value) values.push_back(std::to_string(value));
    return values;
  }
  std::string value;
  int depth = 0;
  for (const char c : text) {
    if (c == '[') ++depth;
    if (c == ']') --depth;
    if (c == ',' && depth == 0) {
      values.push_back(value);
      value.clear();
    } else {
      value += c;
    }
  }
  values.push_back(value);
  return values;
}

std::vector<Axis> parseAxes(const std::vector<std::string>& assignments) {
  std::vector<Axis> axes;
  for (const std::string& assignment : assignments) {
    const auto split = assignment.find(":=");
    if (split == std::string::npos || split == 0) {
      throw Error("'" + assignment + "' is not an assignment: write key:=value or key:=a,b,c.");
    }
    axes.push_back({assignment.substr(0, split), expandValues(assignment.substr(split + 2))});
  }
  return axes;
}

// every combination, the last axis running fastest
std::vector<std::vector<std::string>> combinations(const std::vector<Axis>& axes) {
  std::vector<std::vector<std::string>> all = {{}};
  for (const Axis& axis : axes) {
    std::vector<std::vector<std::string>> longer;
    for (const auto& head : all) {
      for (const std::string& value : axis.values) {
        longer.push_back(head);
        longer.back().push_back(axis.key + ":=" + value);
      }
    }
    all = std::move(longer);
    if (all.size() > 100000) throw Error("the sweep has more than 100000 runs: split it.");
  }
  return all;
}

// the settings that decide a run's numbers: all but where it is written, and its checkpoints
std::string identity(const std::string& yaml) {
  std::istringstream in(yaml);
  std::string line;
  std::string kept;
  std::string section;
  while (std::getline(in, line)) {
    if (!line.empty() && line.front() != ' ') section = line.substr(0, line.find(':'));
    if (section != "results_dir" && section != "run_id" && section != "checkpoint") {
      kept += line + "\n";
    }
  }
  return kept;
}

// a folder name out of the settings that vary: "algorithm_pmeta-lambda_5-seed_0"
std::string nameRun(const Experiment& experiment, const std::vector<Axis>& axes) {
  const std::map<std::string, std::string> values = flatSettings(YAML::Load(experiment.yaml()));
  std::string name;
  for (const Axis& axis : axes) {
    if (axis.values.size() < 2) continue;
    for (const auto& entry : values) {
      const std::string& key = entry.first;
      const std::string last = key.substr(key.rfind('.') + 1);
      if (key != axis.key && last != axis.key) continue;
      name += (name.empty() ? "" : "-") + last + "_" + entry.second;
    }
  }
  static const std::regex kUnfit("[^A-Za-z0-9_.+-]+");
  name = std::regex_replace(name, kUnfit, "_");
  return name.empty() ? "run" : name;
}

// true if a finished run with these settings is there already
bool findFinished(const Experiment& experiment) {
  const std::string dir = experiment.runDir();
  if (runStatus(dir) != "finished") return false;
  std::ifstream file(dir + "/config.yaml");
  std::ostringstream text;
  text << file.rdbuf();
  if (identity(text.str()) != identity(experiment.yaml())) {
    throw Error("the finished run " + dir +
                " has other settings: give this sweep another --name, or remove that folder.");
  }
  return true;
}

// where a run that was cut off goes on; its folder is cleared away if there is no such round
ResumePoint startOf(const Experiment& experiment, bool resume) {
  const std::string dir = experiment.runDir();
  if (resume && !runStatus(dir).empty()) {
    try {
      return findResumePoint(experiment);
    } catch (const Error&) {
      // cut off before its first checkpoint, or of other settings
    }
  }
  std::error_code error;
  std::filesystem::remove_all(dir, error);
  return {};
}

}  // namespace

std::vector<Experiment> planSweep(const SweepPlan& plan) {
  if (plan.name.empty() || plan.name.find('/') != std::string::npos) {
    throw Error("the sweep's name is '" + plan.name + "' but must be a plain name.");
  }
  const std::vector<Axis> axes = parseAxes(plan.assignments);
  std::vector<Experiment> runs;
  std::map<std::string, bool> seen;
  for (const std::vector<std::string>& assignments : combinations(axes)) {
    const Experiment base = Experiment::load(plan.config, assignments);
    if (!seen.emplace(identity(base.yaml()), true).second) continue;
    std::vector<std::string> placed = assignments;
    placed.push_back("results_dir:=" + base.settings().results_dir + "/sweeps/" + plan.name);
    placed.push_back("run_id:=" + nameRun(base, axes));
    if (!plan.resume) placed.push_back("checkpoint.interval:=0");
    runs.push_back(Experiment::load(plan.config, placed));
  }
  return runs;
}

std::string runSweep(const SweepPlan& plan, const std::atomic<bool>& stop,
                     const std::function<void(const SweepProgress&)>& on_progress) {
  const std::vector<Experiment> runs = planSweep(plan);
  const std::string folder = runs.front().settings().results_dir;
  requireWritable(folder);

  std::vector<const Experiment*> open;
  SweepProgress progress;
  progress.total = static_cast<int>(runs.size());
  for (const Experiment& run : runs) {
    if (!findFinished(run)) {
      open.push_back(&run);
      continue;
    }
    ++progress.done;
    progress.skipped = true;
    progress.run_id = run.settings().run_id;
    progress.personal_return = progress.meta_return = std::numeric_limits<double>::quiet_NaN();
    on_progress(progress);
  }
  progress.skipped = false;

  using Clock = std::chrono::steady_clock;
  const auto secondsSince = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  const Clock::time_point begin = Clock::now();
  std::mutex mutex;
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < open.size() && !stop && !failed; i = next++) {
        const Clock::time_point start = Clock::now();
        const ResumePoint point = startOf(*open[i], plan.resume);
        RunLog log =
            point.round > 0 ? RunLog::reopen(*open[i], point.rounds_done) : RunLog(*open[i]);
        const LocalResult result = runLocally(
            *open[i], &log, [&](const RoundBook::Round&) { return !stop; }, point.round);
        log.finish(result.stopped ? "stopped" : "finished");
        if (result.stopped) return;
        std::error_code error;  // a finished run needs no checkpoints, which are most of its size
        std::filesystem::remove_all(log.dir() + "/checkpoint", error);
        const std::lock_guard<std::mutex> lock(mutex);
        ++progress.done;
        progress.run_id = open[i]->settings().run_id;
        progress.personal_return = result.rounds.back().summary.personal_return;
        progress.meta_return = result.rounds.back().summary.meta_return;
        progress.seconds = secondsSince(start);
        const double done_here = progress.done - (runs.size() - open.size());
        progress.eta_seconds = secondsSince(begin) / done_here * (runs.size() - progress.done);
        on_progress(progress);
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      if (!failure) failure = std::current_exception();
      failed = true;
    }
  };
  std::vector<std::thread> threads;
  for (int j = 0; j < plan.jobs; ++j) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
  return folder;
}

}  // namespace pmeta
