#include "pmeta_core/run/meta_aggregator.h"

#include <cmath>
#include <iterator>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/run/divergence.h"

namespace pmeta {

MetaAggregator::MetaAggregator(const Experiment& experiment)
    : rounds_(experiment.settings().rounds),
      settings_(experiment.settings().aggregation),
      rule_(experiment.rule()),
      bound_{settings_.max_update_norm, settings_.outlier_factor},
      quorum_(experiment.quorum()),
      updates_(experiment.participants()),
      norms_(experiment.participants(), 0),
      counts_(experiment.participants()) {
  meta_.run_id = experiment.settings().run_id;
  meta_.settings_hash = experiment.settingsHash();
  meta_.model = experiment.initialModel();
}

MetaAggregator::Answer MetaAggregator::offer(std::shared_ptr<const AuxiliaryUpdate> update) {
  const int task = update->task;
  const std::string reason = refusal(*update);
  if (!reason.empty()) {
    countRefusal(task, reason);
    return {Verdict::kRefused, reason};
  }
  if (update->round <= meta_.round) {
    ++counts_[task].stale;
    return {Verdict::kStale, "round " + std::to_string(update->round) + " is over."};
  }
  if (updates_[task]) {
    ++counts_[task].duplicate;
    return {Verdict::kDuplicate, "this round already has an update of the task."};
  }
  ++counts_[task].accepted;
  if (bound_.bounds()) norms_[task] = distance(update->model, meta_.model);
  updates_[task] = std::move(update);
  return {};
}

bool MetaAggregator::giveUp(int task, const std::string& reason) {
  return failures_.emplace(task, reason).second;
}

std::string MetaAggregator::hopeless() const {
  if (failures_.empty()) return "";
  const int tasks = expected();
  // training tasks come first
  const auto lost =
      static_cast<int>(std::distance(failures_.begin(), failures_.lower_bound(tasks)));
  if (quorum_ < tasks && tasks - lost >= quorum_) return "";
  return failures_.begin()->second;
}

void MetaAggregator::countRefusal(int task, const std::string& reason) {
  if (task < 0 || task >= static_cast<int>(counts_.size())) {
    ++refused_unknown_;
    return;
  }
  ++counts_[task].refused;
  counts_[task].last_reason = reason;
}

std::string MetaAggregator::refusal(const AuxiliaryUpdate& update) const {
  const std::string who = "task " + std::to_string(update.task);
  if (update.run_id != meta_.run_id) {
    return who + " belongs to run " + shown(update.run_id) + ", not to " + shown(meta_.run_id) +
           ".";
  }
  if (update.task < 0 || update.task >= static_cast<int>(updates_.size())) {
    return who + " is not one of this run's " + std::to_string(updates_.size()) + " tasks.";
  }
  if (update.settings_hash != meta_.settings_hash) {
    return otherSettings(who, update.settings_hash, meta_.settings_hash);
  }
  if (update.round > meta_.round + 1) {
    return who + " reports round " + std::to_string(update.round) + " but round " +
           std::to_string(meta_.round + 1) + " is being trained.";
  }
  if (!(update.weight > 0) || update.weight > 1e12) {
    return who + " has weight " + formatNumber(update.weight) + ", which is not a positive number.";
  }
  if (!rule_->weighted() && update.weight != 1) {
    return who + " has weight " + formatNumber(update.weight) + " but aggregation.rule " +
           settings_.rule + " counts all tasks the same: start it with the same configuration.";
  }
  try {
    checkModel(update.model, meta_.model.layout, who);
  } catch (const Error& error) {
    return error.what();
  }
  const std::string diverged = divergence(update.model);
  return diverged.empty() ? "" : who + " sent parameters that have diverged: " + diverged + ".";
}

void MetaAggregator::ask(bool evaluate, bool checkpoint) {
  meta_.evaluate = evaluate;
  meta_.checkpoint = checkpoint;
}

std::vector<int> MetaAggregator::reported() const {
  std::vector<int> tasks;
  for (std::size_t i = 0; i < updates_.size(); ++i) {
    if (updates_[i]) tasks.push_back(static_cast<int>(i));
  }
  return tasks;
}

std::vector<int> MetaAggregator::missing() const {
  std::vector<int> tasks;
  for (std::size_t i = 0; i < updates_.size(); ++i) {
    if (!updates_[i]) tasks.push_back(static_cast<int>(i));
  }
  return tasks;
}

std::vector<int> MetaAggregator::closeRound() {
  const std::vector<int> absent = missing();
  if (absent.size() == updates_.size()) throw std::logic_error("closing a round without updates");
  exclusions_ = findExclusions();
  for (const Exclusion& exclusion : exclusions_) {
    ++counts_[exclusion.task].excluded;
    counts_[exclusion.task].last_reason = exclusion.reason;
    updates_[exclusion.task].reset();
  }
  meta_.participants = reported();
  std::vector<Contribution> contributions;
  for (const int task : meta_.participants) {
    contributions.push_back({&updates_[task]->model, updates_[task]->weight});
  }
  rule_->mix(meta_.model, contributions, settings_.beta);
  ++meta_.round;
  for (auto& update : updates_) update.reset();
  return absent;
}

void MetaAggregator::saveState(StateWriter& writer) const {
  writer.count("round", meta_.round);
  writer.part("meta", meta_.model);
  std::vector<std::uint8_t> participants(updates_.size(), 0);
  for (const int task : meta_.participants) participants[static_cast<std::size_t>(task)] = 1;
  writer.array("participants", participants);
  std::vector<std::int64_t> counts;
  for (const Counts& c : counts_) {
    counts.insert(counts.end(), {c.accepted, c.duplicate, c.stale, c.refused, c.excluded});
  }
  writer.array("counts", counts);
  writer.count("refused_unknown", refused_unknown_);
}

void MetaAggregator::loadState(StateReader& reader) {
  meta_.round = static_cast<int>(reader.count("round", 0, rounds_));
  reader.part("meta", meta_.model);
  std::vector<std::uint8_t> participants(updates_.size());
  reader.array("participants", participants);
  meta_.participants.clear();
  for (std::size_t task = 0; task < participants.size(); ++task) {
    if (participants[task] != 0) meta_.participants.push_back(static_cast<int>(task));
  }
  std::vector<std::int64_t> counts(5 * counts_.size());
  reader.counts("counts", counts);
  for (std::size_t task = 0; task < counts_.size(); ++task) {
    const std::int64_t* c = &counts[5 * task];
    counts_[task] = {c[0], c[1], c[2], c[3], c[4], ""};
  }
  refused_unknown_ = reader.count("refused_unknown");
  exclusions_.clear();
  for (auto& update : updates_) update.reset();
}

std::vector<MetaAggregator::Exclusion> MetaAggregator::findExclusions() const {
  const std::vector<int> tasks = reported();
  std::vector<double> norms;
  for (const int task : tasks) norms.push_back(norms_[task]);
  const std::vector<std::string> objections = bound_.objections(norms);
  std::vector<Exclusion> found;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    if (!objections[i].empty()) found.push_back({tasks[i], objections[i]});
  }
  return found;
}

std::vector<int> MetaAggregator::excluded() const {
  std::vector<int> tasks;
  for (const Exclusion& exclusion : exclusions_) tasks.push_back(exclusion.task);
  return tasks;
}

}  // namespace pmeta
