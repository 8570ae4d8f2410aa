#include "pmeta_core/storage/run_log.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/number.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/storage/manifest.h"

namespace pmeta {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::seconds kManifestInterval{1};
constexpr char kRounds[] = "/rounds.csv";
constexpr char kLosses[] = "/losses.csv";
constexpr char kLossesHeader[] = "round,task,loss,value";

std::string manifestStatus(const std::string& run_dir) { return manifestText(run_dir, "status"); }

// the folder of a new run, which no other has
RunLock takeNew(const Experiment& experiment) {
  const std::string dir = experiment.runDir();
  requireWritable(experiment.settings().results_dir);
  requireWritable(dir);
  RunLock lock(dir);
  if (std::filesystem::exists(dir + "/manifest.json")) {
    throw Error("the run folder " + dir + " already holds a run: choose another run_id.");
  }
  return lock;
}

template <class Number>
bool parseWhole(const std::string& text, Number& value) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  return result.ec == std::errc() && result.ptr == end && value >= 0;
}

template <class Word>
bool parseWord(const std::string& text, std::initializer_list<Word> words, Word& word) {
  for (const Word one : words) {
    if (text != name(one)) continue;
    word = one;
    return true;
  }
  return false;
}

// what RunLog::csvLine() wrote
bool parseRow(const std::string& line, RoundRow& row) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, ',');) fields.push_back(field);
  TaskReturn& r = row.result;
  return fields.size() == 11 && parseWhole(fields[0], r.round) && r.round > 0 &&
         parseWhole(fields[1], r.task) &&
         parseWord(fields[2], {Split::kTrain, Split::kTest}, r.split) &&
         parseWord(fields[3], {PolicyKind::kPersonal, PolicyKind::kMeta}, r.policy) &&
         parseWhole(fields[4], r.context_episodes) && parseNumber(fields[5], r.mean) &&
         parseNumber(fields[6], r.std) && parseWhole(fields[7], r.episodes) &&
         parseWhole(fields[8], row.env_steps) && parseWhole(fields[9], row.updates) &&
         parseNumber(fields[10], r.seconds);
}

[[noreturn]] void refuseLine(const std::string& path, const std::string& line, int number) {
  throw Error(path + " line " + std::to_string(number) + " is " + shown(line) +
              ", which no run writes: it has been altered.");
}

// the whole lines below a table's header, with their numbers, until `on_line` returns false
void readTable(const std::string& path, const std::string& header,
               const std::function<bool(const std::string& line, int number)>& on_line) {
  requireRegularFile(path, "the table");
  std::ifstream file(path);
  std::string line;
  bool headed = false;
  for (int number = 1; std::getline(file, line); ++number) {
    // what a spreadsheet or an editor leaves behind
    if (number == 1 && line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    if (!headed) {
      if (line != header) {
        throw Error(path + " begins with " + shown(line) + " but must begin with '" + header +
                    "': it has been altered, or is of another version.");
      }
      headed = true;
      continue;
    }
    if (file.eof()) return;  // a line that was cut off
    if (!on_line(line, number)) return;
  }
  if (!headed) throw Error(path + " is empty: it has been altered, or was never written.");
}

// the whole lines of rounds 1 to `last`, with the header; `evaluated` is the last that has lines
std::string firstRounds(const std::string& path, int last, int evaluated) {
  std::string kept = std::string(RunLog::csvHeader()) + "\n";
  int newest = 0;
  readRounds(path, [&](const RoundRow& row, const std::string& line) {
    if (row.result.round > last) return false;
    newest = row.result.round;
    kept += line + "\n";
    return true;
  });
  if (newest != evaluated) {
    throw Error(path + " ends with round " + std::to_string(newest) + " but the checkpoint knows " +
                std::to_string(evaluated) + " rounds: the run cannot be resumed.");
  }
  return kept;
}

// the same of losses.csv
std::string firstLosses(const std::string& path, int last) {
  std::string kept = std::string(kLossesHeader) + "\n";
  readTable(path, kLossesHeader, [&](const std::string& line, int number) {
    int round = 0;
    if (!parseWhole(line.substr(0, line.find(',')), round)) refuseLine(path, line, number);
    if (round > last) return false;
    kept += line + "\n";
    return true;
  });
  return kept;
}

}  // namespace

RunLog::RunLog(const Experiment& experiment) : RunLog(create(experiment, takeNew(experiment))) {}

RunLog RunLog::anew(const Experiment& experiment, RunLock lock) {
  for (const auto& entry : std::filesystem::directory_iterator(experiment.runDir())) {
    if (entry.path() != lock.path()) std::filesystem::remove_all(entry.path());
  }
  return create(experiment, std::move(lock));
}

RunLog::RunLog(const Experiment& experiment, const std::string& started, int rounds_done,
               RunLock lock)
    : lock_(std::move(lock)),
      dir_(experiment.runDir()),
      manifest_(constantManifest(experiment, started)),
      rounds_done_(rounds_done) {}

RunLog RunLog::create(const Experiment& experiment, RunLock lock) {
  RunLog log(experiment, utcTime(), 0, std::move(lock));
  experiment.copyModel();
  writeFileAtomically(log.dir_ + "/config.yaml", experiment.runYaml());
  log.writeManifest("running");
  writeFileAtomically(log.dir_ + kRounds, std::string(csvHeader()) + "\n");
  writeFileAtomically(log.dir_ + kLosses, std::string(kLossesHeader) + "\n");
  log.openTables();
  return log;
}

RunLog RunLog::reopen(const Experiment& experiment, int rounds_done) {
  requireResumable(experiment.runDir());
  return reopen(experiment, rounds_done, RunLock(experiment.runDir()));
}

RunLog RunLog::reopen(const Experiment& experiment, int rounds_done, RunLock lock) {
  const std::string dir = experiment.runDir();
  requireUnfinished(dir);
  const std::string started = manifestText(dir, "started");
  RunLog log(experiment, started.empty() ? utcTime() : started, rounds_done, std::move(lock));
  log.broken_episodes_ = manifestCount(dir, "broken_episodes");
  requireWritable(dir);
  const EvaluationSchedule evaluations = experiment.evaluationSchedule();
  int evaluated = rounds_done;
  while (evaluated > 0 && !evaluations.includes(evaluated)) --evaluated;
  const std::string rounds = firstRounds(dir + kRounds, rounds_done, evaluated);
  const std::string losses = firstLosses(dir + kLosses, rounds_done);
  writeFileAtomically(dir + kRounds, rounds);
  writeFileAtomically(dir + kLosses, losses);
  log.writeManifest("running");
  log.openTables();
  return log;
}

void RunLog::openTables() {
  rounds_.emplace(dir_ + kRounds);
  losses_.emplace(dir_ + kLosses);
}

void RunLog::sync() {
  losses_->sync();
  rounds_->sync();
}

void RunLog::write(const RoundBook::Round& round) {
  std::string rows, losses;
  for (const RoundRow& row : round.rows) {
    rows += csvLine(row) + "\n";
    losses += lossLines(row.result);
  }
  losses_->append(losses);
  try {
    rounds_->append(rows);
  } catch (const Error&) {
    // no half a round: whoever tries again finds both files as they were
    losses_->takeBack();
    throw;
  }
  rounds_done_ = round.summary.round;
  broken_episodes_ = round.summary.broken_episodes;
  if (Clock::now() < next_manifest_) return;
  try {
    writeManifest("running");
  } catch (const Error&) {
    // the round is written: a disk that takes no more is told of when the next one is
  }
}

void RunLog::finish(const std::string& status) {
  writeManifest(status);
  lock_.release();
}

void RunLog::fail(const std::string& reason) noexcept {
  try {
    writeManifest("failed", reason);
  } catch (const std::exception&) {
    // as where the disk is full: then nobody writes a run that "runs", which runStatus() sees
  }
  lock_.release();
}

const char* RunLog::csvHeader() {
  return "round,task,split,policy,context_episodes,return_mean,return_std,episodes,env_steps,"
         "updates,wall_s";
}

std::string RunLog::csvLine(const RoundRow& row) {
  const TaskReturn& r = row.result;
  const NumbersWithDots dots;
  char seconds[32];
  std::snprintf(seconds, sizeof seconds, "%.6f", r.seconds);
  return std::to_string(r.round) + "," + std::to_string(r.task) + "," + name(r.split) + "," +
         name(r.policy) + "," + std::to_string(r.context_episodes) + "," + formatNumber(r.mean) +
         "," + formatNumber(r.std) + "," + std::to_string(r.episodes) + "," +
         std::to_string(row.env_steps) + "," + std::to_string(row.updates) + "," + seconds;
}

std::string RunLog::lossLines(const TaskReturn& result) {
  std::string lines;
  for (const Loss& loss : result.losses) {
    lines += std::to_string(result.round) + "," + std::to_string(result.task) + "," + loss.name +
             "," + formatNumber(loss.value) + "\n";
  }
  return lines;
}

void RunLog::writeManifest(const std::string& status, const std::string& reason) {
  auto manifest = nlohmann::ordered_json::parse(manifest_);
  manifest["status"] = status;
  if (reason.empty()) {
    manifest.erase("reason");
  } else {
    manifest["reason"] = reason;
  }
  manifest["rounds_done"] = rounds_done_;
  manifest["broken_episodes"] = broken_episodes_;
  if (status != "running") manifest["ended"] = utcTime();
  // a reason may hold anything
  writeFileAtomically(dir_ + "/manifest.json",
                      manifest.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  next_manifest_ = Clock::now() + kManifestInterval;
}

std::string runStatus(const std::string& run_dir) {
  const std::string status = manifestStatus(run_dir);
  return status == "running" && RunLock::holder(run_dir).empty() ? "interrupted" : status;
}

void requireResumable(const std::string& run_dir) {
  const std::string holder = RunLock::holder(run_dir);
  if (!holder.empty()) {
    throw Error("the run in " + run_dir + " is going on, in " + holder +
                ": wait until that has ended, or stop it.");
  }
  requireUnfinished(run_dir);
}

void requireUnfinished(const std::string& run_dir) {
  const std::string status = manifestStatus(run_dir);
  if (status.empty()) {
    throw Error("there is no run to resume in " + run_dir + ": it has no manifest.json.");
  }
  if (status == "finished") {
    throw Error("the run in " + run_dir + " is finished: there is nothing to resume.");
  }
}

void readRounds(const std::string& path,
                const std::function<bool(const RoundRow& row, const std::string& line)>& on_row) {
  readTable(path, RunLog::csvHeader(), [&](const std::string& line, int number) {
    RoundRow row;
    if (!parseRow(line, row)) refuseLine(path, line, number);
    return on_row(row, line);
  });
}

void writeFileAtomically(const std::string& path, const std::string& text) {
  const std::string temporary = path + ".tmp";
  std::ofstream file(temporary, std::ios::binary);
  file << text;
  file.close();
  std::error_code error;
  if (!file) {
    error.assign(errno, std::generic_category());
  } else {
    std::filesystem::rename(temporary, path, error);
  }
  if (error) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    throw Error("cannot write " + path + " (" + error.message() + ").");
  }
}

}  // namespace pmeta
