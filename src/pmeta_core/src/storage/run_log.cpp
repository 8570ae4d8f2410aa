#include "pmeta_core/storage/run_log.h"

#include <fcntl.h>
#include <unistd.h>

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
  writeFileAtomically(log.dir_ + "/rounds.csv", std::string(csvHeader()) + "\n");
  log.openCsv();
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
  writeFileAtomically(dir + "/rounds.csv",
                      firstRounds(dir + "/rounds.csv", rounds_done, evaluated));
  log.writeManifest("running");
  log.openCsv();
  return log;
}

void RunLog::openCsv() {
  csv_.open(dir_ + "/rounds.csv", std::ios::app);
  std::error_code error;
  csv_size_ = std::filesystem::file_size(dir_ + "/rounds.csv", error);
  if (!csv_ || error) throw Error("cannot write " + dir_ + "/rounds.csv: is the disk full?");
}

void RunLog::sync() {
  const int file = ::open((dir_ + "/rounds.csv").c_str(), O_WRONLY | O_CLOEXEC);
  const bool synced = file >= 0 && ::fsync(file) == 0;
  const std::string why = std::strerror(errno);
  if (file >= 0) ::close(file);
  if (!synced) throw Error("cannot write " + dir_ + "/rounds.csv (" + why + ").");
}

void RunLog::write(const RoundBook::Round& round) {
  std::string lines;
  for (const RoundRow& row : round.rows) lines += csvLine(row) + "\n";
  if (!csv_.is_open()) openCsv();
  csv_ << lines << std::flush;
  if (!csv_) {
    const std::string why = std::strerror(errno);
    // no half a round: whoever tries again finds the file as it was
    csv_.close();
    csv_.clear();
    std::error_code ignored;
    std::filesystem::resize_file(dir_ + "/rounds.csv", csv_size_, ignored);
    throw Error("cannot write " + dir_ + "/rounds.csv (" + why + "): is the disk full?");
  }
  csv_size_ += lines.size();
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
      if (line != RunLog::csvHeader()) {
        throw Error(path + " begins with " + shown(line) + " but must begin with '" +
                    RunLog::csvHeader() + "': it has been altered, or is of another version.");
      }
      headed = true;
      continue;
    }
    if (file.eof()) return;  // a line that was cut off
    RoundRow row;
    if (!parseRow(line, row)) {
      throw Error(path + " line " + std::to_string(number) + " is " + shown(line) +
                  ", which no run writes: it has been altered.");
    }
    if (!on_row(row, line)) return;
  }
  if (!headed) throw Error(path + " is empty: it has been altered, or was never written.");
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
