#include "pmeta_core/run/meta_trainer.h"

#include <cmath>
#include <numeric>
#include <utility>

#include "pmeta_core/adapt/adapted_return.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/stopwatch.h"
#include "pmeta_core/env/faulty_env.h"
#include "pmeta_core/run/divergence.h"

namespace pmeta {

MetaTrainer::MetaTrainer(const Experiment& experiment)
    : experiment_(experiment),
      settings_hash_(experiment.settingsHash()),
      seed_(static_cast<std::uint64_t>(experiment.settings().seed)),
      steps_per_round_(experiment.stepsPerRound()),
      evaluations_(experiment.evaluationSchedule()),
      learner_(experiment.makeMetaLearner()) {
  for (const int task : tasks()) {
    evaluation_.push_back(std::make_unique<Evaluation>(makeEnvs(
        [&](int) { return experiment.family().make(task); }, experiment.metaEvaluationEpisodes())));
  }
  totals_[0].env_steps.assign(static_cast<std::size_t>(experiment.numTasks()), 0);
}

std::vector<int> MetaTrainer::tasks() const {
  std::vector<int> tasks(static_cast<std::size_t>(experiment_.totalTasks()));
  std::iota(tasks.begin(), tasks.end(), 0);
  return tasks;
}

template <class Work>
auto MetaTrainer::guarded(int round, const Work& work) const {
  try {
    return work();
  } catch (const TaskFailed&) {
    throw;
  } catch (const FaultyEnv& fault) {
    throw TaskFailed("round " + std::to_string(round) + " failed: " + fault.what());
  } catch (const BrokenEpisode& episode) {
    fail(round, episode.reason(), simulationSettings(experiment_));
  } catch (const Error& error) {
    std::string what = error.what();
    if (!what.empty() && what.back() == '.') what.pop_back();
    fail(round, what, stepSizes(experiment_));
  }
}

void MetaTrainer::fail(int round, const std::string& what, const std::string& advice) const {
  throw TaskFailed("the meta-learner failed in round " + std::to_string(round) + ": " + what +
                   "; " + advice + ".");
}

std::optional<RoundResult> MetaTrainer::trainRound(const MetaPolicy& meta,
                                                   const KeepGoing& keep_going) {
  checkModel(meta.model, layout(), "the aggregator");
  const int round = meta.round + 1;
  if (between_ && round_ > 0 && round == round_) return lastResult();

  between_ = false;
  learner_->setModel(meta.model);
  if (meta.round != round_) {
    const Totals none{
        std::vector<std::int64_t>(totals_.begin()->second.env_steps.size()), 0, 0, {}};
    totals_ = {{meta.round, none}};
    iterations_ = static_cast<std::uint64_t>(meta.round) << 32;  // draws that were not made before
    surplus_ = 0;
  }
  const Totals before = totals_.at(meta.round);
  Totals totals = before;
  if (!guarded(round, [&] { return train(round, keep_going, totals); })) return std::nullopt;

  const std::string diverged = divergence(learner_->model());
  if (!diverged.empty()) {
    fail(round, "its parameters diverged, " + diverged, stepSizes(experiment_));
  }
  last_ = {};
  last_.env_steps = totals.steps() - before.steps();
  last_.updates = totals.updates - before.updates;
  last_.broken_episodes = totals.broken_episodes - before.broken_episodes;
  last_.losses = totals.losses;
  last_.loss = last_.losses.empty() ? 0 : last_.losses.front().value;
  last_.distance = distance(learner_->model(), meta.model);
  totals_[round] = std::move(totals);
  round_ = round;
  between_ = true;
  forget();
  return lastResult();
}

// the iterations up to the round's end; false if stopped
bool MetaTrainer::train(int round, const KeepGoing& keep_going, Totals& totals) {
  const std::int64_t goal = totals.steps() - surplus_ + steps_per_round_;
  while (totals.steps() < goal) {
    const IterationStats stats = learner_->iterate(seed_, iterations_++);
    for (std::size_t k = 0; k < totals.env_steps.size(); ++k) {
      totals.env_steps[k] += stats.env_steps[k];
    }
    totals.updates += stats.updates;
    totals.losses = learner_->losses();
    totals.broken_episodes += stats.broken_episodes;
    broken_episodes_ += stats.broken_episodes;
    for (const Loss& loss : learner_->losses()) {
      if (std::isfinite(loss.value)) continue;
      fail(round, std::string(loss.name) + " is " + formatNumber(loss.value),
           stepSizes(experiment_));
    }
    const std::int64_t done = totals.steps() - goal + steps_per_round_;
    if (keep_going && !keep_going(std::min(done, steps_per_round_))) return false;
  }
  surplus_ = totals.steps() - goal;
  return true;
}

// but what returns of this round and the one before are still to be told with
void MetaTrainer::forget() {
  const int oldest = evaluatedBefore(round_ - 1);
  while (totals_.begin()->first < oldest) totals_.erase(totals_.begin());
}

// the last round before `round` that the schedule evaluates; 0 if there is none
int MetaTrainer::evaluatedBefore(int round) const {
  for (int before = round - 1; before > 0; --before) {
    if (evaluations_.includes(before)) return before;
  }
  return 0;
}

RoundResult MetaTrainer::lastResult() const {
  RoundResult result = last_;
  result.update = {
      experiment_.settings().run_id, number(), round_, learner_->model(), 1, settings_hash_};
  return result;
}

std::vector<TaskReturn> MetaTrainer::evaluateMeta(const MetaPolicy& meta) {
  checkModel(meta.model, layout(), "the aggregator");
  std::vector<TaskReturn> results;
  if (!evaluations_.includes(meta.round) && !meta.evaluate) return results;
  evaluated_.reset();  // what adapted from the model before it
  evaluated_.emplace(Evaluated{meta.round, meta.model, {}});
  evaluated_->adaptations.resize(evaluation_.size());
  for (const int task : tasks()) {
    const auto of_task = guarded(meta.round, [&] {
      return evaluateTask(task, meta, evaluated_->model,
                          evaluated_->adaptations[static_cast<std::size_t>(task)]);
    });
    results.insert(results.end(), of_task.begin(), of_task.end());
  }
  return results;
}

std::vector<TaskReturn> MetaTrainer::evaluateTask(int task, const MetaPolicy& meta,
                                                  const Model& model,
                                                  std::unique_ptr<Adaptation>& adaptation) {
  const Stopwatch watch;
  adaptation = learner_->adapt(model, task);
  const std::vector<int> counts = explorationEpisodes();
  Rng rng = evaluationRng(task);
  std::vector<TaskReturn> results;
  for (const AdaptedReturn& adapted :
       evaluateAdapted(*evaluation_[static_cast<std::size_t>(task)], *adaptation, counts, rng)) {
    TaskReturn result;
    result.run_id = experiment_.settings().run_id;
    result.task = task;
    result.round = meta.round;
    result.scheduled = evaluations_.includes(meta.round);
    result.split = experiment_.isTestTask(task) ? Split::kTest : Split::kTrain;
    result.policy = PolicyKind::kMeta;
    result.context_episodes = adapted.context_episodes;
    result.mean = adapted.stats.mean;
    result.std = adapted.stats.std;
    result.episodes = adapted.stats.episodes;
    result.broken_episodes = adapted.stats.broken_episodes;
    result.seconds = watch.seconds();
    broken_episodes_ += result.broken_episodes;
    // once: the columns of rounds.csv are sums
    if (results.empty() && result.scheduled) addCosts(result);
    if (!std::isfinite(result.mean) || !std::isfinite(result.std)) {
      fail(meta.round,
           "the return on " + experiment_.family().taskName(task) + " is " +
               formatNumber(result.mean) + " +- " + formatNumber(result.std),
           stepSizes(experiment_));
    }
    results.push_back(std::move(result));
  }
  return results;
}

// of the training since the last scheduled evaluation, as far as it is known
void MetaTrainer::addCosts(TaskReturn& result) const {
  if (result.split != Split::kTrain) return;
  const auto found = totals_.find(result.round);
  if (found == totals_.end()) return;
  const Totals& now = found->second;
  const Totals& before = totals_.lower_bound(evaluatedBefore(result.round))->second;
  const auto task = static_cast<std::size_t>(result.task);
  result.env_steps = now.env_steps[task] - before.env_steps[task];
  result.updates = now.updates - before.updates;
  if (task != 0) return;
  result.broken_episodes += now.broken_episodes - before.broken_episodes;
  result.losses = now.losses;
}

Episode MetaTrainer::recordMeta(const MetaPolicy& meta, int task) const {
  if (!evaluated_ || meta.round != evaluated_->round) refuseUnevaluated(meta);
  const auto k = static_cast<std::size_t>(task);
  Rng rng = evaluationRng(task);
  const Adaptation& adaptation = *evaluated_->adaptations.at(k);
  const std::unique_ptr<Actor> actor = adaptation.adapted(1);
  Episode episode = evaluation_[k]->record(*actor, rng);
  episode.task_weights = adaptation.taskWeights();
  return episode;
}

ReturnStats MetaTrainer::evaluateFresh(const Model& policy, int task, int episodes) const {
  const auto k = static_cast<std::size_t>(task);
  const std::vector<int> counts = explorationEpisodes();
  return overFreshEpisodes(seed_, task, episodes, [&](Rng& rng) {
    const std::unique_ptr<Adaptation> adaptation = learner_->adapt(policy, task);
    return evaluateAdapted(*evaluation_[k], *adaptation, counts, rng).back().stats;
  });
}

std::vector<int> MetaTrainer::explorationEpisodes() const {
  std::vector<int> counts = experiment_.contextEpisodes();
  counts.erase(counts.begin());  // none
  return counts;
}

// the same draws for every round: differences are the policies', not the dice's
Rng MetaTrainer::evaluationRng(int task) const {
  return Rng(seed_, static_cast<std::uint64_t>(task), Stream::kEvaluate);
}

void MetaTrainer::saveState(StateWriter& writer) const {
  if (!between_) {
    throw Error(
        "the meta-learner was stopped in the middle of a round: its state can be saved "
        "after a whole one.");
  }
  writer.count("round", round_);
  writer.count("iterations", static_cast<std::int64_t>(iterations_));
  writer.count("surplus", surplus_);
  writer.count("broken_episodes", broken_episodes_);
  writer.count("oldest_totals", totals_.begin()->first);
  for (const auto& [round, totals] : totals_) {
    writer.part("totals_" + std::to_string(round), totals);
  }
  writer.part("last", last_);
  writer.part("model", learner_->model());
  writer.part("learner", *learner_);
}

void MetaTrainer::loadState(StateReader& reader) {
  round_ = static_cast<int>(reader.count("round", 0, evaluations_.rounds));
  iterations_ = static_cast<std::uint64_t>(reader.count("iterations"));
  surplus_ = reader.count("surplus");
  broken_episodes_ = reader.count("broken_episodes");
  const auto oldest = static_cast<int>(reader.count("oldest_totals", 0, round_));
  totals_.clear();
  for (int round = oldest; round <= round_; ++round) {
    Totals& totals = totals_[round];
    totals.env_steps.resize(static_cast<std::size_t>(experiment_.numTasks()));
    reader.part("totals_" + std::to_string(round), totals);
  }
  reader.part("last", last_);
  Model model(layout());
  reader.part("model", model);
  learner_->setModel(model);
  reader.part("learner", *learner_);
  evaluated_.reset();
  between_ = true;
}

std::int64_t MetaTrainer::Totals::steps() const {
  return std::accumulate(env_steps.begin(), env_steps.end(), std::int64_t{0});
}

void MetaTrainer::Totals::saveState(StateWriter& writer) const {
  writer.array("env_steps", env_steps);
  writer.count("updates", updates);
  writer.count("broken_episodes", broken_episodes);
  saveLosses(writer, losses);
}

void MetaTrainer::Totals::loadState(StateReader& reader) {
  reader.counts("env_steps", env_steps);
  updates = reader.count("updates");
  broken_episodes = reader.count("broken_episodes");
  losses = readLosses(reader);
}

}  // namespace pmeta
