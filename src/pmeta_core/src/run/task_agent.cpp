#include "pmeta_core/run/task_agent.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/stopwatch.h"
#include "pmeta_core/env/faulty_env.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {
namespace {

// of the last round's log weight, what stays in this one's
constexpr double kWeightMemory = 0.8;
constexpr double kMostLogWeight = 100;  // catch_up / (1 - kWeightMemory) is at most 50

}  // namespace

TaskAgent::TaskAgent(const Experiment& experiment, int task)
    : run_id_(experiment.settings().run_id),
      settings_hash_(experiment.settingsHash()),
      name_("task " + std::to_string(task) + " (" + experiment.family().taskName(task) + ")"),
      step_sizes_(stepSizes(experiment)),
      simulation_settings_(simulationSettings(experiment)),
      seed_(static_cast<std::uint64_t>(experiment.settings().seed)),
      task_(task),
      split_(experiment.isTestTask(task) ? Split::kTest : Split::kTrain),
      updates_per_round_(experiment.settings().updates_per_round),
      keeps_personal_(experiment.keepsPersonal()),
      sends_personal_(experiment.algorithm().sent == Sent::kPersonal),
      evaluations_(experiment.evaluationSchedule()),
      catch_up_(experiment.settings().aggregation.catch_up),
      learner_(experiment.makeLearner(task)) {}

// a learner's errors, with what else there is to know; it is always the same that comes of them
template <class Work>
auto TaskAgent::guarded(int round, const Work& work) const {
  try {
    return work();
  } catch (const TaskFailed&) {
    throw;
  } catch (const FaultyEnv& fault) {
    throw TaskFailed("round " + std::to_string(round) + " failed: " + fault.what());
  } catch (const LostEnvironment& lost) {
    throw TaskFailed(name_ + " failed in round " + std::to_string(round) + ": " + lost.what());
  } catch (const BrokenEpisode& episode) {
    fail(round, episode.reason(), simulation_settings_);
  } catch (const Error& error) {
    std::string what = error.what();
    if (!what.empty() && what.back() == '.') what.pop_back();
    fail(round, what, step_sizes_);
  }
}

std::optional<RoundResult> TaskAgent::trainRound(const MetaPolicy& meta,
                                                 const KeepGoing& keep_going) {
  if (!trains()) throw Error("task " + std::to_string(task_) + " is a test task: not trained on.");
  checkModel(meta.model, learner_->layout(), "the aggregator");
  const Stopwatch watch;
  const int round = meta.round + 1;
  if (between_ && round_ > 0 && round == round_) return lastResult();

  RoundResult result;
  between_ = false;
  learner_->beginRound(meta.model, keeps_personal_);
  if (!guarded(round, [&] { return train(round, keep_going, result); })) return std::nullopt;

  result.losses = learner_->losses();
  result.distance = distance(learner_->personal(), meta.model);
  if (!std::isfinite(result.distance)) fail(round, "its personal parameters diverged", step_sizes_);
  const std::string diverged = divergence(sent());
  if (!diverged.empty()) fail(round, "its parameters diverged, " + diverged, step_sizes_);
  env_steps_ += result.env_steps;
  updates_ += result.updates;
  unreported_broken_ += result.broken_episodes;
  const bool scheduled = evaluations_.includes(round);
  if (scheduled || meta.evaluate) {
    Rng evaluation = evaluationRng();
    TaskReturn personal = makeReturn(round, PolicyKind::kPersonal, guarded(round, [&] {
                                       return learner_->evaluate(learner_->personal(), evaluation);
                                     }));
    personal.broken_episodes += unreported_broken_;
    personal.scheduled = scheduled;
    personal.losses = result.losses;
    personal.env_steps = env_steps_;
    personal.updates = updates_;
    personal.seconds = watch.seconds();
    if (scheduled) {
      env_steps_ = updates_ = unreported_broken_ = 0;
      adjustWeight(personal.mean);
    }
    result.personal = std::move(personal);
  }
  last_ = std::move(result);
  round_ = round;
  between_ = true;
  return lastResult();
}

// the round's updates; false if stopped
bool TaskAgent::train(int round, const KeepGoing& keep_going, RoundResult& result) {
  Rng rng(seed_, task_, Stream::kSample, round);
  for (int r = 1; r <= updates_per_round_; ++r) {
    const UpdateStats stats = learner_->update(rng);
    result.env_steps += stats.env_steps;
    result.updates += stats.updates;
    result.loss = stats.loss;
    result.broken_episodes += stats.broken_episodes;
    broken_episodes_ += stats.broken_episodes;
    if (!std::isfinite(stats.loss)) {
      fail(round, "the loss of update " + std::to_string(r) + " is " + formatNumber(stats.loss),
           step_sizes_);
    }
    if (keep_going && !keep_going(r)) return false;
  }
  return true;
}

// a simulation that breaks down now and then gives wild numbers before it does
void TaskAgent::fail(int round, const std::string& what, const std::string& advice) const {
  const bool broke = broken_episodes_ > 0 && advice != simulation_settings_;
  throw TaskFailed(name_ + " failed in round " + std::to_string(round) + ": " + what + "; " +
                   advice +
                   (broke ? "; or, since " + std::to_string(broken_episodes_) +
                                " of its episodes broke down, " + simulation_settings_
                          : "") +
                   ".");
}

RoundResult TaskAgent::lastResult() const {
  RoundResult result = last_;
  result.update = {run_id_, task_, round_, sent(), std::exp(log_weight_), settings_hash_};
  return result;
}

const Model& TaskAgent::sent() const {
  return sends_personal_ ? learner_->personal() : learner_->auxiliary();
}

std::vector<TaskReturn> TaskAgent::evaluateMeta(const MetaPolicy& meta) {
  checkModel(meta.model, learner_->layout(), "the aggregator");
  std::vector<TaskReturn> results;
  const bool scheduled = evaluations_.includes(meta.round);
  if (!scheduled && !meta.evaluate) return results;
  const Stopwatch watch;
  Rng rng = evaluationRng();
  const std::vector<AdaptedReturn> all =
      guarded(meta.round, [&] { return learner_->evaluateAdapted(meta.model, rng); });
  for (const AdaptedReturn& adapted : all) {
    results.push_back(makeReturn(meta.round, PolicyKind::kMeta, adapted.stats));
    results.back().scheduled = scheduled;
    results.back().context_episodes = adapted.context_episodes;
    results.back().seconds = watch.seconds();
  }
  if (scheduled) meta_return_ = results.back().mean;
  adapted_ = all.back();
  adapted_round_ = meta.round;
  return results;
}

ReturnStats TaskAgent::evaluateFresh(PolicyKind kind, const Model& policy, int episodes) const {
  return overFreshEpisodes(seed_, task_, episodes, [&](Rng& rng) {
    return kind == PolicyKind::kPersonal ? learner_->evaluate(policy, rng)
                                         : learner_->evaluateAdapted(policy, rng).back().stats;
  });
}

void TaskAgent::saveState(StateWriter& writer) const {
  if (!trains()) throw Error("task " + std::to_string(task_) + " is a test task: it has no state.");
  if (!between_) {
    throw Error("task " + std::to_string(task_) +
                " was stopped in the middle of a round: its state can be saved after a whole one.");
  }
  writer.count("round", round_);
  writer.count("env_steps", env_steps_);
  writer.count("updates", updates_);
  writer.count("unreported_broken", unreported_broken_);
  writer.count("broken_episodes", broken_episodes_);
  writer.value("log_weight", log_weight_);
  writer.flag("has_meta_return", meta_return_.has_value());
  writer.value("meta_return", meta_return_.value_or(0));
  writer.part("last", last_);
  writer.part("learner", *learner_);
}

void TaskAgent::loadState(StateReader& reader) {
  if (!trains()) throw Error("task " + std::to_string(task_) + " is a test task: it has no state.");
  round_ = static_cast<int>(reader.count("round", 0, evaluations_.rounds));
  env_steps_ = reader.count("env_steps");
  updates_ = reader.count("updates");
  unreported_broken_ = reader.count("unreported_broken");
  broken_episodes_ = reader.count("broken_episodes");
  log_weight_ = reader.finite("log_weight");
  if (std::abs(log_weight_) > kMostLogWeight) reader.refuse("log_weight", "is out of its range");
  const auto meta_return = reader.value<double>("meta_return");
  meta_return_.reset();
  if (reader.flag("has_meta_return")) meta_return_ = meta_return;
  reader.part("last", last_);
  if (last_.personal) {
    if (last_.personal->task != task_ || last_.personal->round != round_) {
      reader.refuse("last/personal", "is of another task or round");
    }
    last_.personal->run_id = run_id_;
  }
  reader.part("learner", *learner_);
  between_ = true;
}

void TaskAgent::savePersonal(const Experiment& experiment, int round) const {
  if (!trains()) return;
  saveRunPolicy(experiment, Kept::kLast, personalOrigin(round), personal());
}

void TaskAgent::keepBest(const Experiment& experiment) {
  const PolicyOrigin origin = personalOrigin(round_);
  if (origin.mean_return) best_.offer(experiment, origin, personal());
}

PolicyOrigin TaskAgent::personalOrigin(int round) const {
  PolicyOrigin origin{PolicyKind::kPersonal, task_, round, std::nullopt, taskInput()};
  const std::optional<TaskReturn>& result = last_.personal;
  if (round == round_ && result && result->scheduled) origin.mean_return = result->mean;
  return origin;
}

std::optional<Episode> TaskAgent::recordPersonal() const {
  Rng rng = evaluationRng();
  return learner_->record(learner_->personal(), rng);
}

Episode TaskAgent::recordMeta(const MetaPolicy& meta, int) const {
  checkModel(meta.model, learner_->layout(), "the aggregator");
  if (meta.round != adapted_round_) refuseUnevaluated(meta);
  Rng rng = evaluationRng();
  return learner_->recordAdapted(meta.model, adapted_, rng);
}

// log w <- 0.8 log w + catch_up * gap, where gap in [0, 1] is how far the meta-policy that this
// round began with lies behind the personal policy, as a share of the latter's return
void TaskAgent::adjustWeight(double personal_return) {
  if (!meta_return_ || catch_up_ == 0) return;
  const double scale = std::max(std::abs(personal_return), 1e-9);
  const double gap = std::clamp((personal_return - *meta_return_) / scale, 0.0, 1.0);
  log_weight_ = kWeightMemory * log_weight_ + catch_up_ * gap;
}

// the same draws for every policy and round: differences are the policies', not the dice's
Rng TaskAgent::evaluationRng() const { return Rng(seed_, task_, Stream::kEvaluate); }

TaskReturn TaskAgent::makeReturn(int round, PolicyKind policy, const ReturnStats& stats) {
  broken_episodes_ += stats.broken_episodes;
  if (!std::isfinite(stats.mean) || !std::isfinite(stats.std)) {
    fail(round,
         std::string("the return of the ") + name(policy) + " policy is " +
             formatNumber(stats.mean) + " +- " + formatNumber(stats.std),
         step_sizes_);
  }
  TaskReturn result;
  result.run_id = run_id_;
  result.task = task_;
  result.round = round;
  result.split = split_;
  result.policy = policy;
  result.mean = stats.mean;
  result.std = stats.std;
  result.episodes = stats.episodes;
  result.broken_episodes = stats.broken_episodes;
  return result;
}

}  // namespace pmeta
