// What runs a sweep consists of: values, combinations, and a folder name for each.
#include <charconv>
#include <filesystem>
#include <limits>
#include <map>
#include <regex>
#include <set>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/hash.h"
#include "pmeta_core/run/sweep.h"

namespace pmeta {
namespace {

constexpr std::int64_t kMostValues = 100000;
constexpr std::size_t kLongestName = 120;  // of a file 255 bytes, and a bag's adds to it

struct Axis {
  std::string key;
  std::vector<std::string> values;
};

// "1,5,10" or "[1,2],[3,4]": commas inside brackets belong to a value
std::vector<std::string> splitValues(const std::string& text) {
  std::vector<std::string> values(1);
  int depth = 0;
  for (const char c : text) {
    if (c == '[') ++depth;
    if (c == ']') --depth;
    if (c == ',' && depth == 0) {
      values.emplace_back();
    } else {
      values.back() += c;
    }
  }
  return values;
}

std::int64_t rangeEnd(const std::string& digits, const std::string& range) {
  std::int64_t value = 0;
  const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (result.ec != std::errc()) {
    throw Error("the range " + shown(range) + " goes beyond the largest whole number, " +
                std::to_string(std::numeric_limits<std::int64_t>::max()) + ".");
  }
  return value;
}

// "1,5,10", "0-9" or "0-2,5,7-9"
std::vector<std::string> expandValues(const std::string& text) {
  static const std::regex kRange("([0-9]+)-([0-9]+)");
  std::vector<std::string> values;
  for (const std::string& value : splitValues(text)) {
    std::smatch range;
    if (!std::regex_match(value, range, kRange)) {
      values.push_back(value);
      continue;
    }
    const std::int64_t first = rangeEnd(range[1], value);
    const std::int64_t last = rangeEnd(range[2], value);
    if (last < first || last - first >= kMostValues) {
      throw Error("the range " + shown(value) + " must go up, by less than " +
                  std::to_string(kMostValues) + ".");
    }
    for (std::int64_t step = 0; step <= last - first; ++step) {
      values.push_back(std::to_string(first + step));
    }
  }
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
    if (all.size() > static_cast<std::size_t>(kMostValues)) {
      throw Error("the sweep has more than " + std::to_string(kMostValues) + " runs: split it.");
    }
  }
  return all;
}

// a name out of the settings that vary: "algorithm_pmeta-lambda_5-seed_0"
std::string plainName(const Experiment& experiment, const std::vector<Axis>& axes) {
  const std::map<std::string, std::string> values = flatSettings(YAML::Load(experiment.yaml()));
  std::string name;
  for (const Axis& axis : axes) {
    if (axis.values.size() < 2) continue;
    for (const auto& [key, value] : values) {
      const std::string last = key.substr(key.rfind('.') + 1);
      if (key != axis.key && last != axis.key) continue;
      // of a path the file's name will do
      const bool is_path = key == "environment.model_file";
      name += (name.empty() ? "" : "-") + last + "_" +
              (is_path ? std::filesystem::path(value).filename().string() : value);
    }
  }
  static const std::regex kUnfit("[^A-Za-z0-9_.+-]+");
  name = std::regex_replace(name, kUnfit, "_");
  return name.empty() ? "run" : name;
}

// what decides a run's numbers
std::map<std::string, std::string> withoutName(std::map<std::string, std::string> settings) {
  settings.erase("run_id");
  return settings;
}

std::string shortHash(const Experiment& run) {
  std::string text;
  for (const auto& [key, value] : withoutName(run.definingSettings()))
    text += key + ": " + value + "\n";
  return hashText(text).substr(0, 16);
}

// a folder for each run: what is too long, or would be another run's too, is told apart by a hash
std::vector<std::string> nameRuns(const std::vector<Experiment>& runs,
                                  const std::vector<Axis>& axes) {
  std::vector<std::string> names;
  std::map<std::string, int> uses;
  for (const Experiment& run : runs) {
    names.push_back(plainName(run, axes));
    ++uses[names.back()];
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (uses[names[i]] == 1 && names[i].size() <= kLongestName) continue;
    names[i] = names[i].substr(0, kLongestName) + "-" + shortHash(runs[i]);
  }
  return names;
}

}  // namespace

void requireSameSettings(const Experiment& experiment) {
  const std::string dir = experiment.runDir();
  if (!std::filesystem::exists(dir + "/config.yaml")) return;
  const auto found = withoutName(Experiment::definingSettingsOf(dir));
  const auto expected = withoutName(experiment.definingSettings());
  const std::string key = firstDifference(found, expected);
  if (key.empty()) return;
  const auto shown = [&](const std::map<std::string, std::string>& settings) {
    const auto value = settings.find(key);
    return value == settings.end() ? std::string("not set") : value->second;
  };
  throw Error("the run " + dir + " has other settings, with " + key + " " + shown(found) +
              " where this sweep has " + shown(expected) +
              ": give this sweep another --name, or remove that folder.");
}

std::vector<Experiment> planSweep(const SweepPlan& plan) {
  requirePlainName("the sweep's name", plan.name);
  const std::vector<Axis> axes = parseAxes(plan.assignments);
  std::vector<std::vector<std::string>> assignments;
  std::vector<Experiment> unplaced;
  std::set<std::map<std::string, std::string>> seen;
  for (const std::vector<std::string>& combination : combinations(axes)) {
    const Experiment run = Experiment::load(plan.config, combination);
    if (!seen.insert(withoutName(run.definingSettings())).second) continue;
    assignments.push_back(combination);
    unplaced.push_back(run);
  }
  const std::vector<std::string> names = nameRuns(unplaced, axes);
  std::vector<Experiment> runs;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::vector<std::string>& placed = assignments[i];
    placed.push_back("results_dir:=" + unplaced[i].settings().results_dir + "/sweeps/" + plan.name);
    placed.push_back("run_id:=" + names[i]);
    if (!plan.resume) placed.push_back("checkpoint.interval:=0");
    runs.push_back(Experiment::load(plan.config, placed));
    requireSameSettings(runs.back());
  }
  return runs;
}

}  // namespace pmeta
