#include "pmeta_core/run/meta_aggregator.h"

#include <cmath>

#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr double kLargest = 1e150;  ///< sums of larger values, with their weights, could overflow

}  // namespace

MetaAggregator::MetaAggregator(const Experiment& experiment)
    : beta_(experiment.settings().aggregation.beta),
      quorum_(experiment.quorum()),
      updates_(experiment.numTasks()),
      counts_(experiment.numTasks()) {
  meta_.run_id = experiment.settings().run_id;
  meta_.model = experiment.makeLearner(0)->initialModel(
      static_cast<std::uint64_t>(experiment.settings().seed));
}

MetaAggregator::Answer MetaAggregator::offer(std::shared_ptr<const AuxiliaryUpdate> update) {
  const int task = update->task;
  const bool known = task >= 0 && task < static_cast<int>(updates_.size());
  const std::string reason = refusal(*update);
  if (!reason.empty()) {
    ++(known ? counts_[task].refused : refused_unknown_);
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
  updates_[task] = std::move(update);
  return {};
}

std::string MetaAggregator::refusal(const AuxiliaryUpdate& update) const {
  const std::string who = "task " + std::to_string(update.task);
  if (update.run_id != meta_.run_id) {
    return who + " belongs to run '" + update.run_id + "', not to '" + meta_.run_id + "'.";
  }
  if (update.task < 0 || update.task >= static_cast<int>(updates_.size())) {
    return who + " is not one of this run's " + std::to_string(updates_.size()) + " tasks.";
  }
  if (update.round > meta_.round + 1) {
    return who + " reports round " + std::to_string(update.round) + " but round " +
           std::to_string(meta_.round + 1) + " is being trained.";
  }
  if (!(update.weight > 0) || update.weight > 1e12) {
    return who + " has weight " + formatNumber(update.weight) + ", which is not a positive number.";
  }
  try {
    checkModel(update.model, meta_.model.layout, who);
  } catch (const Error& error) {
    return error.what();
  }
  if (const auto* values = std::get_if<std::vector<double>>(&update.model.values)) {
    for (std::size_t k = 0; k < values->size(); ++k) {
      if (!update.model.isPresent(k) || std::abs((*values)[k]) <= kLargest) continue;
      return who + " sent " + formatNumber((*values)[k]) + " (entry " + std::to_string(k) +
             "), which is beyond " + formatNumber(kLargest) +
             ": has its training diverged? Lower alpha or lambda.";
    }
  }
  return "";
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
  std::vector<Contribution> contributions;
  for (const auto& update : updates_) {
    if (update) contributions.push_back({&update->model, update->weight});
  }
  if (contributions.empty()) throw std::logic_error("closing a round without updates");
  mixInto(meta_.model, contributions, beta_);
  meta_.participants = reported();
  ++meta_.round;
  for (auto& update : updates_) update.reset();
  return absent;
}

}  // namespace pmeta
