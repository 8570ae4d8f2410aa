#include "pmeta_core/run/fresh_evaluation.h"

#include "pmeta_core/base/settings.h"

namespace pmeta {

void FreshEvaluation::offer(const RoundBook::Round& round, const std::deque<TaskAgent>& agents,
                            const MetaPolicy& meta) {
  const RoundSummary& summary = round.summary;
  std::vector<Model> personal;
  for (const TaskAgent& agent : agents) {
    if (agent.trains()) personal.push_back(agent.personal());
  }
  last_personal_ = {summary.round, summary.personal_return, std::move(personal)};
  last_meta_ = {summary.round, summary.meta_return, {meta.model}};
  // a missing return is not a number, and never better
  if (last_personal_.value > best_personal_.value) best_personal_ = last_personal_;
  if (last_meta_.value > best_meta_.value) best_meta_ = last_meta_;
  own_best_.resize(last_personal_.models.size());
  for (const RoundRow& row : round.rows) {
    if (row.result.policy != PolicyKind::kPersonal) continue;
    Kept& kept = own_best_[static_cast<std::size_t>(row.result.task)];
    if (!(row.result.mean > kept.value)) continue;
    kept = {summary.round, row.result.mean, {agents[row.result.task].personal()}};
  }
}

std::vector<FreshReturn> FreshEvaluation::evaluate(const std::deque<TaskAgent>& agents,
                                                   int episodes, bool cross) const {
  std::vector<FreshReturn> rows;
  const int n = static_cast<int>(last_personal_.models.size());
  const auto personal = [&](const char* snapshot, const Kept& kept) {
    for (int trained = 0; trained < static_cast<int>(kept.models.size()); ++trained) {
      for (int task = 0; task < n; ++task) {
        if (task != trained && !cross) continue;
        rows.push_back(
            {snapshot, kept.round, PolicyKind::kPersonal, trained, task, Split::kTrain,
             agents[task].evaluateFresh(PolicyKind::kPersonal, kept.models[trained], episodes)});
      }
    }
  };
  const auto meta = [&](const char* snapshot, const Kept& kept) {
    const int all = static_cast<int>(agents.size());
    for (int task = 0; task < all && !kept.models.empty(); ++task) {
      rows.push_back({snapshot, kept.round, PolicyKind::kMeta, -1, task,
                      agents[task].trains() ? Split::kTrain : Split::kTest,
                      agents[task].evaluateFresh(PolicyKind::kMeta, kept.models[0], episodes)});
    }
  };
  personal("last", last_personal_);
  personal("best", best_personal_);
  for (int task = 0; task < n; ++task) {
    if (own_best_[task].models.empty()) continue;
    rows.push_back(
        {"own_best", own_best_[task].round, PolicyKind::kPersonal, task, task, Split::kTrain,
         agents[task].evaluateFresh(PolicyKind::kPersonal, own_best_[task].models[0], episodes)});
  }
  // without a meta return there is no meta-policy to speak of
  if (!best_meta_.models.empty()) {
    meta("last", last_meta_);
    meta("best", best_meta_);
  }
  return rows;
}

void FreshEvaluation::saveState(StateWriter& writer) const {
  writer.part("last_personal", last_personal_);
  writer.part("best_personal", best_personal_);
  writer.part("last_meta", last_meta_);
  writer.part("best_meta", best_meta_);
  writer.count("own_best", static_cast<std::int64_t>(own_best_.size()));
  for (std::size_t i = 0; i < own_best_.size(); ++i) {
    writer.part("own_best_" + std::to_string(i), own_best_[i]);
  }
}

void FreshEvaluation::loadState(StateReader& reader, const std::deque<TaskAgent>& agents) {
  // models of the right layouts and owned entries, to be filled
  std::vector<Model> personal;
  for (const TaskAgent& agent : agents) {
    if (agent.trains()) personal.push_back(agent.personal());
  }
  const std::vector<Model> meta = {Model(personal.front().layout)};
  last_personal_ = load(reader, "last_personal", personal);
  best_personal_ = load(reader, "best_personal", personal);
  last_meta_ = load(reader, "last_meta", meta);
  best_meta_ = load(reader, "best_meta", meta);
  const auto n = static_cast<std::size_t>(
      reader.count("own_best", 0, static_cast<std::int64_t>(personal.size())));
  if (n != last_personal_.models.size()) reader.refuse("own_best", "is not one for each task");
  own_best_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    own_best_.push_back(load(reader, "own_best_" + std::to_string(i), {personal[i]}));
  }
}

void FreshEvaluation::Kept::saveState(StateWriter& writer) const {
  writer.count("round", round);
  writer.value("value", value);
  writer.count("models", static_cast<std::int64_t>(models.size()));
  for (std::size_t i = 0; i < models.size(); ++i) {
    writer.part("model_" + std::to_string(i), models[i]);
  }
}

// nothing kept, or as many models as `like`
FreshEvaluation::Kept FreshEvaluation::load(StateReader& reader, const std::string& name,
                                            const std::vector<Model>& like) {
  const auto most = static_cast<std::int64_t>(like.size());
  Kept kept;
  kept.round = static_cast<int>(reader.count(name + "/round", 0, std::numeric_limits<int>::max()));
  kept.value = reader.value<double>(name + "/value");
  const std::int64_t n = reader.count(name + "/models", 0, most);
  if (n != 0 && n != most) reader.refuse(name + "/models", "is not one for each task");
  if (n != 0) kept.models = like;
  for (std::size_t i = 0; i < kept.models.size(); ++i) {
    reader.part(name + "/model_" + std::to_string(i), kept.models[i]);
  }
  return kept;
}

std::string FreshEvaluation::csv(const std::vector<FreshReturn>& rows) {
  std::string text =
      "snapshot,round,policy,trained_task,task,split,return_mean,return_std,episodes\n";
  for (const FreshReturn& row : rows) {
    text += row.snapshot + "," + std::to_string(row.round) + "," + name(row.policy) + "," +
            std::to_string(row.trained_task) + "," + std::to_string(row.task) + "," +
            name(row.split) + "," + formatNumber(row.stats.mean) + "," +
            formatNumber(row.stats.std) + "," + std::to_string(row.stats.episodes) + "\n";
  }
  return text;
}

}  // namespace pmeta
