#include "pmeta_core/run/console.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

constexpr int kBarWidth = 20;
constexpr double kLongestSilence = 10;  // seconds
constexpr std::size_t kNumberWidth = 11;
constexpr std::size_t kBestWidth = 20;
const char* const kMean = "mean";
const char* const kTestMean = "mean of test tasks";

std::string bestText(double best, int round) {
  if (std::isnan(best)) return "-";
  return shortNumber(best) + padded("(" + std::to_string(round) + ")", 8, true);
}

int tenths(int round, int rounds) { return static_cast<int>(10LL * round / rounds); }

std::string bytesText(double bytes) {
  if (bytes < 999.5) return significant(bytes, 3) + " B";
  if (bytes < 999.5e3) return significant(bytes / 1e3, 3) + " kB";
  return significant(bytes / 1e6, 3) + " MB";
}

}  // namespace

RunConsole::RunConsole(const Experiment& experiment, bool terminal)
    : num_tasks_(experiment.numTasks()),
      has_personal_(!experiment.hasMetaLearner()),
      rounds_(experiment.settings().rounds),
      adapted_(experiment.contextEpisodes().back()),
      terminal_(terminal),
      tasks_(experiment.totalTasks()),
      cumulative_steps_(experiment.totalTasks(), -1) {
  for (int task = 0; task < experiment.totalTasks(); ++task) {
    names_.push_back(experiment.family().taskName(task));
  }
}

void RunConsole::Course::add(double value, int round) {
  if (std::isnan(value)) return;
  last = value;
  if (std::isnan(best) || value > best) {
    best = value;
    best_round = round;
  }
}

void RunConsole::takeRows(const RoundBook::Round& round) {
  for (const RoundRow& row : round.rows) {
    const TaskReturn& result = row.result;
    Courses& courses = tasks_.at(result.task);
    if (result.policy == PolicyKind::kPersonal) {
      courses.personal.add(result.mean, result.round);
    } else if (result.context_episodes == adapted_) {
      courses.meta.add(result.mean, result.round);
    }
    std::int64_t& before = cumulative_steps_.at(result.task);
    if (before < 0) before = row.env_steps - result.env_steps;  // a run that goes on
    steps_ += row.env_steps - before;
    before = row.env_steps;
  }
  const RoundSummary& summary = round.summary;
  means_.personal.add(summary.personal_return, summary.round);
  means_.meta.add(summary.meta_return, summary.round);
  test_.add(summary.test_return, summary.round);
}

bool RunConsole::isDue(const RoundBook::Round& round) const {
  if (silence_ >= kLongestSilence) return true;
  if (round.rows.empty()) return false;
  return terminal_ || tenths(round.summary.round, rounds_) != printed_tenths_;
}

void RunConsole::recall(const std::string& rounds_csv) {
  RoundBook::Round round;
  const auto close = [&] {
    if (round.rows.empty()) return;
    setMeans(round, adapted_);
    takeRows(round);
    round.rows.clear();
    evaluated_ = true;
  };
  readRounds(rounds_csv, [&](const RoundRow& row, const std::string&) {
    if (row.result.task >= static_cast<int>(tasks_.size())) {
      throw Error(rounds_csv + " has a task " + std::to_string(row.result.task) +
                  ", and the run has none of that number: it has been altered.");
    }
    if (row.result.round != round.summary.round) close();
    round.summary.round = row.result.round;
    round.rows.push_back(row);
    return true;
  });
  close();
  steps_ = 0;  // those of a past that was not watched
}

std::string RunConsole::take(const RoundBook::Round& round) {
  const RoundSummary& summary = round.summary;
  seconds_ += summary.seconds;
  silence_ += summary.seconds;
  const bool due = isDue(round);
  if (due) {
    silence_ = 0;
    printed_tenths_ = tenths(summary.round, rounds_);
  }
  const std::string all = std::to_string(rounds_);
  const std::string bar = terminal_ ? progressBar(summary.round, rounds_, kBarWidth) + " " : "";
  std::string line = bar + "round " + padded(std::to_string(summary.round), all.size(), true);
  line += "/" + all;
  if (!round.rows.empty()) {
    evaluated_ = true;
    takeRows(round);
    if (has_personal_) line += "  PP " + shortNumber(summary.personal_return);
    line += "  MP " + shortNumber(summary.meta_return);
    if (num_tasks_ < static_cast<int>(tasks_.size())) {
      line += "  test " + shortNumber(summary.test_return);
    }
    const double speed = seconds_ > 0 ? static_cast<double>(steps_) / seconds_
                                      : std::numeric_limits<double>::quiet_NaN();
    line += "  " + shortCount(speed) + " steps/s";
    seconds_ = 0;
    steps_ = 0;
  }
  return due ? line + "  ETA " + duration(summary.eta_seconds) : "";
}

std::string RunConsole::tableLine(const std::string& name, const Courses& courses,
                                  std::size_t width) const {
  const auto columns = [](const Course& course) {
    return padded(shortNumber(course.last), kNumberWidth, true) +
           padded(bestText(course.best, course.best_round), kBestWidth, true);
  };
  return padded(name, width) + (has_personal_ ? columns(courses.personal) : "") +
         columns(courses.meta) + "\n";
}

std::string RunConsole::table() const {
  if (!evaluated_) return "";
  const bool tests = num_tasks_ < static_cast<int>(tasks_.size());
  std::vector<std::string> labels;
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    labels.push_back(std::to_string(task) + " " + names_[task] +
                     (static_cast<int>(task) < num_tasks_ ? "" : " (test)"));
  }
  std::size_t width = std::string(tests ? kTestMean : kMean).size();
  for (const std::string& label : labels) width = std::max(width, label.size());

  const auto heads = [](const std::string& policy) {
    return padded(policy + " last", kNumberWidth, true) +
           padded(policy + " best (round)", kBestWidth, true);
  };
  std::string text =
      padded("task", width) + (has_personal_ ? heads("PP") : "") + heads("MP") + "\n";
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    text += tableLine(labels[task], tasks_[task], width);
  }
  text += tableLine(kMean, means_, width);
  if (tests) text += tableLine(kTestMean, {Course(), test_}, width);
  return text;
}

std::string progressBar(int done, int all, int width) {
  const int cells = all <= 0 ? 0 : static_cast<int>(static_cast<long long>(width) * done / all);
  const int full = std::min(std::max(cells, 0), width);
  std::string bar(full, '=');
  if (full > 0 && full < width) bar.back() = '>';
  return "[" + bar + std::string(width - full, ' ') + "]";
}

std::string listRunFolder(const std::string& dir) {
  namespace fs = std::filesystem;
  std::vector<std::string> lines;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(dir, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory(error)) {
      const fs::recursive_directory_iterator below(entry.path(), error);
      const auto files =
          std::count_if(begin(below), end(below), [](const fs::directory_entry& one) {
            std::error_code gone;
            return one.is_regular_file(gone);
          });
      lines.push_back("  " + padded(name + "/", 16) + std::to_string(files) +
                      (files == 1 ? " file" : " files"));
    } else {
      lines.push_back("  " + padded(name, 16) +
                      bytesText(static_cast<double>(entry.file_size(error))));
    }
  }
  std::sort(lines.begin(), lines.end());
  std::string text = "results in " + dir + "\n";
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace pmeta
