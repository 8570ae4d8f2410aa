#include "pmeta_core/run/task_agent.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace pmeta {
namespace {

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

TaskAgent::TaskAgent(const Experiment& experiment, int task)
    : run_id_(experiment.settings().run_id),
      seed_(static_cast<std::uint64_t>(experiment.settings().seed)),
      task_(task),
      updates_per_round_(experiment.settings().updates_per_round),
      keeps_personal_(experiment.keepsPersonal()),
      sends_personal_(experiment.sendsPersonal()),
      learner_(experiment.makeLearner(task)) {}

std::optional<TaskAgent::RoundResult> TaskAgent::trainRound(const MetaPolicy& meta,
                                                            const KeepGoing& keep_going) {
  checkModel(meta.model, learner_->layout(), "the aggregator");
  const Stopwatch watch;
  const int round = meta.round + 1;
  Rng rng(seed_, task_, Stream::kSample, round);

  RoundResult result;
  std::int64_t env_steps = 0;
  std::int64_t updates = 0;
  learner_->beginRound(meta.model, keeps_personal_);
  for (int r = 1; r <= updates_per_round_; ++r) {
    const UpdateStats stats = learner_->update(rng);
    env_steps += stats.env_steps;
    updates += stats.updates;
    result.loss = stats.loss;
    if (keep_going && !keep_going(r)) return std::nullopt;
  }

  result.distance = distance(learner_->personal(), meta.model);
  result.personal = evaluate(learner_->personal());
  result.personal.round = round;
  result.personal.env_steps = env_steps;
  result.personal.updates = updates;
  result.personal.seconds = watch.seconds();
  result.update = {run_id_, task_, round,
                   sends_personal_ ? learner_->personal() : learner_->auxiliary(), 1.0};
  return result;
}

TaskReturn TaskAgent::evaluateMeta(const MetaPolicy& meta) const {
  checkModel(meta.model, learner_->layout(), "the aggregator");
  const Stopwatch watch;
  TaskReturn result = evaluate(meta.model);
  result.round = meta.round;
  result.policy = Policy::kMeta;
  result.seconds = watch.seconds();
  return result;
}

ReturnStats TaskAgent::evaluateFresh(const Model& policy, int episodes) const {
  ReturnStats total;
  double mean_of_squares = 0;
  for (std::uint64_t batch = 1; total.episodes < episodes; ++batch) {
    // rounds evaluate with round 0 of this stream
    Rng rng(seed_, task_, Stream::kEvaluate, batch);
    const ReturnStats stats = learner_->evaluate(policy, rng);
    const double share = static_cast<double>(stats.episodes) / (total.episodes + stats.episodes);
    total.mean += share * (stats.mean - total.mean);
    mean_of_squares += share * (stats.mean * stats.mean + stats.std * stats.std - mean_of_squares);
    total.episodes += stats.episodes;
  }
  total.std = std::sqrt(std::max(0.0, mean_of_squares - total.mean * total.mean));
  return total;
}

Episode TaskAgent::recordPersonal() const {
  Rng rng = evaluationRng();
  return learner_->record(learner_->personal(), rng);
}

Episode TaskAgent::recordMeta(const MetaPolicy& meta) const {
  checkModel(meta.model, learner_->layout(), "the aggregator");
  Rng rng = evaluationRng();
  return learner_->record(meta.model, rng);
}

// the same draws for every policy and round: differences are the policies', not the dice's
Rng TaskAgent::evaluationRng() const { return Rng(seed_, task_, Stream::kEvaluate); }

TaskReturn TaskAgent::evaluate(const Model& policy) const {
  Rng rng = evaluationRng();
  const ReturnStats stats = learner_->evaluate(policy, rng);
  TaskReturn result;
  result.run_id = run_id_;
  result.task = task_;
  result.mean = stats.mean;
  result.std = stats.std;
  result.episodes = stats.episodes;
  return result;
}

}  // namespace pmeta
