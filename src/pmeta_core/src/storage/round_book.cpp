// What becomes of returns as they arrive: complete rounds, in order, with their means.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/storage/round_book.h"

namespace pmeta {
namespace {

constexpr double kLargestResult = 1e150;  // of which a mean over tasks is still finite

double meanReturn(const std::vector<RoundRow>& rows, PolicyKind policy, Split split, int context) {
  double sum = 0;
  int n = 0;
  for (const RoundRow& row : rows) {
    const TaskReturn& r = row.result;
    if (r.policy != policy || r.split != split || r.context_episodes != context) continue;
    sum += r.mean;
    ++n;
  }
  return n == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / n;
}

// what losses.csv is made of; their values may be any
template <class Refuse>
void requireLosses(const TaskReturn& result, const Refuse& refuse) {
  if (result.losses.size() > kMostLosses) {
    refuse("it has " + std::to_string(result.losses.size()) + " losses");
  }
  for (const Loss& loss : result.losses) {
    const bool word = std::all_of(loss.name.begin(), loss.name.end(), [](unsigned char c) {
      return c == '_' || (c < 128 && std::isalnum(c) != 0);
    });
    if (!word || loss.name.empty() || loss.name.size() > kLongestLossName) {
      refuse("it names a loss " + shown(loss.name) + ", which is no word");
    }
  }
}

}  // namespace

RoundBook::RoundBook(const Experiment& experiment)
    : num_tasks_(experiment.numTasks()),
      total_tasks_(experiment.totalTasks()),
      contexts_(experiment.contextEpisodes()),
      evaluations_(experiment.evaluationSchedule()),
      rounds_(experiment.settings().rounds),
      expects_meta_(experiment.evaluatesMeta()),
      run_id_(experiment.settings().run_id),
      env_steps_(experiment.totalTasks(), 0),
      updates_(experiment.totalTasks(), 0) {}

bool RoundBook::add(const TaskReturn& result) {
  if (result.run_id != run_id_ || result.task < 0 || result.task >= total_tasks_ ||
      result.round < next_ || result.round > rounds_ || !evaluations_.includes(result.round) ||
      !result.scheduled) {
    return false;
  }
  // what no agent of this run evaluates
  const bool tests = result.task >= num_tasks_;
  const bool personal = result.policy == PolicyKind::kPersonal;
  const bool known_context =
      personal ? result.context_episodes == 0
               : std::count(contexts_.begin(), contexts_.end(), result.context_episodes) > 0;
  if (tests != (result.split == Split::kTest) || (tests && personal) || !known_context) {
    return false;
  }
  const auto key =
      std::make_tuple(static_cast<int>(result.policy), result.task, result.context_episodes);
  const auto open = open_.find(result.round);
  if (open != open_.end() && open->second.results.count(key) != 0) return false;
  requireResult(result);
  return open_[result.round].results.emplace(key, result).second;
}

// the sums that rounds.csv and the manifest hold must be counts too
void RoundBook::requireResult(const TaskReturn& result) const {
  const auto refuse = [&](const std::string& why) {
    throw Error("the return of task " + std::to_string(result.task) + " in round " +
                std::to_string(result.round) + " is no result: " + why + ".");
  };
  for (const double value : {result.mean, result.std, result.seconds}) {
    if (!std::isfinite(value) || std::abs(value) > kLargestResult) {
      refuse("it holds " + formatNumber(value));
    }
  }
  if (result.std < 0 || result.seconds < 0 || result.seconds > kMostCounted) {
    refuse("its deviation is " + formatNumber(result.std) + ", its wall time " +
           formatNumber(result.seconds) + " s");
  }
  requireLosses(result, refuse);
  if (result.episodes < 1) refuse("it is of " + std::to_string(result.episodes) + " episodes");
  std::int64_t env_steps = env_steps_[result.task];
  std::int64_t updates = updates_[result.task];
  std::int64_t broken = broken_episodes_;
  const auto count = [&](const TaskReturn& r) {
    for (const auto& [sum, more] : {std::pair{&env_steps, r.env_steps},
                                    {&updates, r.updates},
                                    {&broken, r.broken_episodes}}) {
      if (more < 0 || more > kMostCounted - *sum) refuse("its counts are beyond those of any run");
      *sum += more;
    }
  };
  for (const auto& [round, open] : open_) {
    for (const auto& [key, other] : open.results) {
      if (other.task == result.task) count(other);
    }
  }
  count(result);
}

void RoundBook::closeRound(int round, const std::vector<int>& participants,
                           const std::vector<int>& missing, double seconds,
                           const std::vector<int>& excluded) {
  Open& open = open_[round];
  open.closed = true;
  open.summary.run_id = run_id_;
  open.summary.round = round;
  open.summary.rounds = rounds_;
  open.summary.participants = participants;
  open.summary.missing = missing;
  open.summary.excluded = excluded;
  open.summary.seconds = seconds;
}

bool RoundBook::Open::hasPersonal(int task) const {
  return results.count({static_cast<int>(PolicyKind::kPersonal), task, 0}) != 0;
}

bool RoundBook::Open::reported(int task) const {
  const auto holds = [task](const std::vector<int>& tasks) {
    return std::find(tasks.begin(), tasks.end(), task) != tasks.end();
  };
  return holds(summary.participants) || holds(summary.excluded);
}

bool RoundBook::Open::hasMeta(int task, const std::vector<int>& contexts) const {
  return std::all_of(contexts.begin(), contexts.end(), [&](int context) {
    return results.count({static_cast<int>(PolicyKind::kMeta), task, context}) != 0;
  });
}

bool RoundBook::isComplete(int round, const Open& open) const {
  if (!open.closed) return false;
  if (!evaluations_.includes(round)) return true;
  for (int task = 0; task < num_tasks_; ++task) {
    if (open.reported(task) && !open.hasPersonal(task)) return false;
  }
  for (int task = 0; expects_meta_ && task < total_tasks_; ++task) {
    if (!open.hasMeta(task, contexts_)) return false;
  }
  return true;
}

std::vector<RoundBook::Round> RoundBook::take(bool force) {
  std::vector<Round> taken;
  for (auto it = open_.find(next_); it != open_.end(); it = open_.find(next_)) {
    Open& open = it->second;
    if (!isComplete(next_, open) && !(force && open.closed)) break;
    Round round;
    round.summary = open.summary;
    // the map's order is the file's order: policy, then task, then context
    for (auto& entry : open.results) {
      RoundRow row;
      row.result = entry.second;
      row.env_steps = env_steps_[row.result.task] += row.result.env_steps;
      row.updates = updates_[row.result.task] += row.result.updates;
      broken_episodes_ += row.result.broken_episodes;
      round.rows.push_back(std::move(row));
    }
    round.summary.broken_episodes = broken_episodes_;
    seconds_ += round.summary.seconds;
    setMeans(round, contexts_.back());
    round.summary.eta_seconds = seconds_ / next_ * (rounds_ - next_);
    taken.push_back(std::move(round));
    open_.erase(it);
    ++next_;
  }
  return taken;
}

bool RoundBook::hasPersonal(int round) const {
  if (!evaluations_.includes(round)) return true;
  const auto it = open_.find(round);
  if (it == open_.end()) return false;
  for (int task = 0; task < num_tasks_; ++task) {
    if (!it->second.hasPersonal(task)) return false;
  }
  return true;
}

std::vector<int> RoundBook::awaited() const {
  std::vector<int> tasks;
  if (next_ > rounds_ || !evaluations_.includes(next_)) return tasks;
  const auto it = open_.find(next_);
  // a closed round does without the personal returns of those it missed
  const auto owesPersonal = [&](int task) {
    if (task >= num_tasks_) return false;
    return it == open_.end() || !it->second.closed || it->second.reported(task);
  };
  for (int task = 0; task < total_tasks_; ++task) {
    const bool none = it == open_.end();
    if ((owesPersonal(task) && (none || !it->second.hasPersonal(task))) ||
        (expects_meta_ && (none || !it->second.hasMeta(task, contexts_)))) {
      tasks.push_back(task);
    }
  }
  return tasks;
}

void RoundBook::saveState(StateWriter& writer) const {
  writer.count("rounds_taken", roundsTaken());
  writer.array("env_steps", env_steps_);
  writer.array("updates", updates_);
  writer.count("broken_episodes", broken_episodes_);
  writer.value("seconds", seconds_);
  std::int64_t closed = 0;
  std::int64_t returns = 0;
  for (const auto& [round, open] : open_) {
    if (open.closed) writer.part("closed_" + std::to_string(closed++), open.summary);
    for (const auto& entry : open.results) {
      writer.part("return_" + std::to_string(returns++), entry.second);
    }
  }
  writer.count("closed", closed);
  writer.count("returns", returns);
}

void RoundBook::loadState(StateReader& reader) {
  open_.clear();
  next_ = static_cast<int>(reader.count("rounds_taken", 0, rounds_)) + 1;
  reader.counts("env_steps", env_steps_);
  reader.counts("updates", updates_);
  broken_episodes_ = reader.count("broken_episodes");
  seconds_ = reader.value<double>("seconds");
  const std::int64_t closed = reader.count("closed", 0, rounds_);
  for (std::int64_t k = 0; k < closed; ++k) {
    RoundSummary summary;
    reader.part("closed_" + std::to_string(k), summary);
    const auto known = [&](const std::vector<int>& tasks) {
      return tasks.empty() || tasks.back() < num_tasks_;  // ascending
    };
    if (summary.round < next_ || summary.round > rounds_ || !known(summary.participants) ||
        !known(summary.missing) || !known(summary.excluded)) {
      reader.refuse("closed_" + std::to_string(k), "is no open round of this run");
    }
    closeRound(summary.round, summary.participants, summary.missing, summary.seconds,
               summary.excluded);
  }
  const std::int64_t returns = reader.count("returns");
  for (std::int64_t k = 0; k < returns; ++k) {
    TaskReturn result;
    reader.part("return_" + std::to_string(k), result);
    result.run_id = run_id_;
    if (!add(result)) {
      reader.refuse("return_" + std::to_string(k), "is none that this run still waits for");
    }
  }
}

void setMeans(RoundBook::Round& round, int adapted) {
  RoundSummary& summary = round.summary;
  summary.personal_return = meanReturn(round.rows, PolicyKind::kPersonal, Split::kTrain, 0);
  summary.meta_return = meanReturn(round.rows, PolicyKind::kMeta, Split::kTrain, adapted);
  summary.test_return = meanReturn(round.rows, PolicyKind::kMeta, Split::kTest, adapted);
}

}  // namespace pmeta
